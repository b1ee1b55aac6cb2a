from .association import associated as associated
from .counting import operations as operations
from .linear import as_written as as_written
from .linear import over as over
from .linear import solve_spd as solve_spd
from .normal_form import TooManyTerms as TooManyTerms
from .normal_form import collect as collect
from .zeros import without as without
