"""Active disturbance rejection, from encoders alone: a controller whose states are an observer.

Error form: R. Madonski, S. Shao, H. Zhang, Z. Gao, J. Yang, S. Li, General error-based active disturbance rejection
control for swift industrial implementations, Control Engineering Practice 84 (2019). One bandwidth for the observer
and one for the controller: Z. Gao, Scaling and bandwidth-parameterization based controller tuning, American Control
Conference 2003. Here it has the arm's model besides, so that the disturbance is only what the model does not know.
"""

import casadi as ca

from springline.model import Control, Controller, Parameter, Quantity, named, section
from springline.model.parameters import POSITIVE


class Adrc(Controller):
    """dde + 2 w_c de + w_c^2 e = 0 for the error as an observer sees it, whatever d drives the arm.

    e = q1d - q1,  dde = ddq1d - H^-1 (u - C dq1 - G) - d

    The observer has three poles at -w_o. Its d is the integral action; it is told the command that U_max let through,
    and so does not wind up.
    """

    title = "active disturbance rejection from the encoders alone"
    parameters = (
        Parameter("w_c", "1/s", 20.0, "bandwidth of the error", POSITIVE, per_joint=True),
        Parameter("w_o", "1/s", 100.0, "bandwidth of the observer", POSITIVE, per_joint=True),
    )
    states = (
        Quantity("e_hat", r"\hat e", "{q}", "observed error"),
        Quantity("de_hat", r"\dot{\hat e}", "{q}/s", "observed rate of the error"),
        Quantity("d_hat", r"\hat d", "{q}/s^2", "observed disturbance"),
    )

    def control(self, r, y, z, model, p):
        with section("error and rate, of the encoders"):
            e = named("e", r.q - y.q1)
            off = named("off", e - z.e_hat)
            rate = named("rate", r.dq - z.de_hat)  # not y.dq1: nobody measures it
        arm = model(y.q1, rate)
        with section("command"):
            wished = named("wished", r.ddq - z.d_hat + 2 * p.w_c * z.de_hat + p.w_c**2 * e)
            u = arm.H @ wished + arm.c + arm.G

        def dz(limited):
            expected = named("expected", ca.solve(arm.H, limited - arm.c - arm.G))
            return {
                "e_hat": z.de_hat + 3 * p.w_o * off,
                "de_hat": r.ddq - expected - z.d_hat + 3 * p.w_o**2 * off,
                "d_hat": -(p.w_o**3) * off,
            }

        return Control(u, e, dz)
