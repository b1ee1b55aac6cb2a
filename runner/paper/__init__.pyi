from .cases import GROUPS as GROUPS
from .reproduction import reproduce as reproduce
