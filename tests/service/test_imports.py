"""What the process that answers requests holds in memory."""

from __future__ import annotations

import subprocess
import sys


def test_the_service_holds_no_compiled_kernels() -> None:
    """It queues tunings and hands analyses on; numba alone would be a quarter of its memory."""
    code = "import sys, service.http.app; print('numba' in sys.modules, 'plotly' in sys.modules)"
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-c", code], capture_output=True, check=True, text=True, timeout=120
    )
    assert done.stdout.split() == ["False", "False"]
