"""`python -m attrito.cli`."""

import sys

from attrito.cli.program import main

sys.exit(main())
