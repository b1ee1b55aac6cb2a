from .functions import procedure as procedure
from .header import float_header as float_header
from .header import math_header as math_header
from .words import COMMUTATIVE as COMMUTATIVE
from .words import INFIX as INFIX
from .words import Kind as Kind
from .words import Op as Op
from .words import Procedure as Procedure
