"""The contracts that every algorithm keeps, each as a check that any class can be put to."""

from sketchmatch.testing.conformance.checking import (
    check_plugin,
    parametrize_plugins,
    plugin_checks,
)
from sketchmatch.testing.conformance.contract import (
    TIME_LIMIT,
    CheckResult,
    CheckState,
    ContractViolationError,
    PluginCheck,
)
from sketchmatch.testing.conformance.report import SearchReport, search_report

__all__ = [
    "TIME_LIMIT",
    "CheckResult",
    "CheckState",
    "ContractViolationError",
    "PluginCheck",
    "SearchReport",
    "check_plugin",
    "parametrize_plugins",
    "plugin_checks",
    "search_report",
]
