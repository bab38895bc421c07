"""What the server that workers are forked from imports: the service, with its kernels compiled.

The import itself does the compiling: that is the one thing that Python's fork server can be
told to do, and every process forked from it is then ready at once.
"""

import gc

import service.app  # noqa: F401 - imported for the processes forked later
from solver.warm import warm

__all__: list[str] = []

warm()
# The collector writes into every object that it looks at, and a page written to is no longer
# shared: what is here now it need not look at.
gc.collect()
gc.freeze()
