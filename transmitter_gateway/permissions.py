"""Which requests to the arbiter need an operator."""

from collections.abc import Collection

from rcopterx.transmitter_gateway.inputs import Action, ActionRequest

FOR_OPERATORS = {
    Action.ARM: "only an operator may arm",
    Action.DISARM: "only an operator may disarm",
    Action.RESET: "only an operator may reset a kill",
}
"""Actions for operators only, and the reason given to others; kill and shutdown are for anyone."""


def refusal(request: ActionRequest, operators: Collection[str]) -> str | None:
    """Why `request` is refused, by the names of the operators; None if it is allowed."""
    return None if request.by in operators else FOR_OPERATORS.get(request.action)
