from .body import Body as Body
from .link import Link as Link
from .mechanism import Mechanism as Mechanism
from .plausible import expect_plausible as expect_plausible
from .registry import MECHANISMS as MECHANISMS
