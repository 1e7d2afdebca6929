"""Who may ask the arbiter for what."""

from collections.abc import Collection

from rcopterx.transmitter_gateway.inputs import Action, ActionRequest

FOR_OPERATORS = {
    Action.ARM: "only an operator may arm",
    Action.DISARM: "only an operator may disarm",
    Action.RESET: "only an operator may reset a kill",
}
"""What is not for everybody, and what others are told; kill and shutdown are for anyone."""


def refusal(request: ActionRequest, operators: Collection[str]) -> str | None:
    """Why a request is not for the one who asks; None if it is.

    Parameters
    ----------
    request : ActionRequest
        What is asked for, and by whom.
    operators : collection of str
        Names whose requests count as an operator's.
    """
    return None if request.by in operators else FOR_OPERATORS.get(request.action)
