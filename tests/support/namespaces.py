"""Network namespaces as hosts, where this computer and user can create them."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import pytest

from rcopterx_studies.benchmarks.namespaces import NetworkNamespaces, NetworkUnavailableError, network


@contextmanager
def network_or_skip(hosts: Sequence[str]) -> Iterator[NetworkNamespaces]:
    """A network of these hosts; the test is skipped with the reason where namespaces need other rights."""
    with ExitStack() as stack:
        try:
            net = stack.enter_context(network(hosts))
        except NetworkUnavailableError as error:
            pytest.skip(str(error))
        yield net
