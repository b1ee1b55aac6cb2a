from .equations import EquationsOfMotion as EquationsOfMotion
from .equations import equations_of_motion as equations_of_motion
