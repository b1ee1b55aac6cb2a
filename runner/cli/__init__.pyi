from .amounts import time_text as time_text
from .application import app as app
from .application import main as main
from .options import expect_folder as expect_folder
from .terminal import print_json as print_json
from .terminal import print_table as print_table
from .terminal import progress as progress
from .terminal import say as say
