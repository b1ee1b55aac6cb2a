from .archive import fmu as fmu
from .settings import Settings as Settings
