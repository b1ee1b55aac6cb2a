"""From the symbolic model of a series-elastic manipulator on a moving base to C, batches, figures and tables.

    import springline as sl
    result = sl.simulate(sl.load_scenario("paper/nominal"))

The rooms behind this face are springline.model, springline.codegen and springline.runner.
"""

import pkgutil

import lazy_loader

# Started in a checkout, Python finds this folder before the installed package, whose rooms are elsewhere.
__path__ = pkgutil.extend_path(__path__, __name__)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
