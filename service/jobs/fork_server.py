"""What the server that workers are forked from imports: what computes, with its kernels compiled.

Neither HTTP nor the database: what is here is in memory a second time beside the service itself.

The import itself does the compiling: that is the one thing that Python's fork server can be
told to do, and every process forked from it is then ready at once.
"""

# ruff: noqa: F401 - all imported for the processes forked later

import gc
from importlib import import_module

import service.drawing
import service.jobs.pool
import service.jobs.work
from service import registry
from solver.warm import warm

__all__: list[str] = []

for _analysis in registry.every():
    for _module in _analysis.computes_with:
        import_module(_module)
warm()
# The collector writes into every object that it looks at, and a page written to is no longer
# shared: what is here now it need not look at.
gc.collect()
gc.freeze()
