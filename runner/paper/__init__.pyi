from .cases import GROUPS as GROUPS
from .cases import INPUTS as INPUTS
from .reproduction import reproduce as reproduce
