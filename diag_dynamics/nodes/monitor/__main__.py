"""The monitor, by ``python3 -m diag_dynamics.nodes.monitor``."""

import sys

from diag_dynamics.nodes.monitor.monitor import main

sys.exit(main())
