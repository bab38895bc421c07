"""What the server that workers are forked from imports: what computes, with its kernels compiled.

Neither HTTP nor the database: what is here is in memory a second time beside the service itself.

The import itself does the compiling: that is the one thing that Python's fork server can be
told to do, and every process forked from it is then ready at once.
"""

# ruff: noqa: F401 - all imported for the processes forked later

import gc

import service.computing
import service.jobs.pool
import service.jobs.work
import solver.certificate.search
import solver.interaction.analysis
import solver.interaction.decoupling
import solver.interaction.drive_simulation
import solver.interaction.loop_effect
import solver.interaction.parallel_drives
import solver.relay
import solver.robustness.analysis
import solver.robustness.integrity
import solver.simulation.worst_actuators
from solver.warm import warm

__all__: list[str] = []

warm()
# The collector writes into every object that it looks at, and a page written to is no longer
# shared: what is here now it need not look at.
gc.collect()
gc.freeze()
