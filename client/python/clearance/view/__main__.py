"""`python -m clearance.view` is `clearance view`."""

import sys

from .command import main

sys.exit(main())
