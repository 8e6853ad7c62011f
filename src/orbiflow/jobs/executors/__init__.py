"""Where jobs run: processes of this machine, or the workers of a Dask cluster.

A `Parcel` is a request with the bytes that it reads, an `Answer` its events with the bytes that it
wrote: nothing else travels, so that machines need no disk in common.
"""

from orbiflow.jobs.executors.dask_cluster import DaskCluster
from orbiflow.jobs.executors.executor import Executor
from orbiflow.jobs.executors.local_processes import LocalProcesses
from orbiflow.jobs.executors.parcel import Answer, Parcel

__all__ = ["Answer", "DaskCluster", "Executor", "LocalProcesses", "Parcel"]
