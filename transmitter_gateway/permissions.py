"""Who may ask the arbiter for what."""

from collections.abc import Collection

from rcopterx.transmitter_gateway.inputs import Action, ActionRequest


def refusal(request: ActionRequest, holder: str | None, operators: Collection[str]) -> str | None:
    """Why a request is not for the one who asks; None if it is.

    Arming is for an operator or the source itself, disarming for the lease holder or an operator, reset
    for an operator, hand-over for the holder or an operator; kill and shutdown are for anyone.

    Parameters
    ----------
    request : ActionRequest
        What is asked for, and by whom.
    holder : str or None
        Source with the control lease.
    operators : collection of str
        Names whose requests count as an operator's.
    """
    operator = request.by in operators
    match request.action:
        case Action.ARM:
            if not (operator or request.by == request.source):
                return "only an operator or the source itself may arm"
            if holder not in (None, request.source):
                return f"{holder} has the control lease: hand over instead"
        case Action.DISARM if not (operator or request.by == holder):
            return "only the holder of the control lease or an operator may disarm"
        case Action.HAND_OVER if not (operator or request.by == holder):
            return "only the holder of the control lease or an operator may hand over"
        case Action.RESET if not operator:
            return "only an operator may reset a kill"
    return None
