"""Reports of fault flights in which two vehicles fly on."""

from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.reports import Report, report_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS

FLEW = {
    "h1": SeenFlight(100, 20.4, None, None, 41.2, ("armed",)),
    "h2": SeenFlight(100, 31.0, None, None, 39.0, ("armed",)),
}


def flown(name: str, problem: str | None = None) -> Report:
    """Report of a row."""
    return report_of(FAULT_FLIGHTS[name], FLEW, problem, 5.0)
