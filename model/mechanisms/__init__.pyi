from .mechanism import Mechanism as Mechanism
from .registry import MECHANISMS as MECHANISMS
