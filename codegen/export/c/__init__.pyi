from .interface import Field as Field
from .interface import TypedInterface as TypedInterface
from .texts import text_files as text_files
from .tree import generate_files as generate_files
from .vectors import Overflow as Overflow
