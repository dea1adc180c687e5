"""The view, by ``python3 -m diag_dynamics.nodes.view``."""

import sys

from diag_dynamics.nodes.view.view import main

sys.exit(main())
