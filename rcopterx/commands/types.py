"""Vehicle types: `types`."""

from rcopterx.commands.output import JsonOption, print_document


def types(as_json: JsonOption = False) -> None:
    """List the vehicle types that fleet files and new-lab can name, those of installed packages included."""
    from rcopterx.commands.fleet_option import user_errors
    from rcopterx.fleet.vehicle_types import type_names, vehicle_type

    with user_errors():
        found = [vehicle_type(name) for name in type_names()]
    document = {
        one.name: {
            "text": one.file.text,
            "protocol": one.file.transmitter.protocol,
            "settings": one.file.transmitter.settings,
            "airframe": one.model.airframe,
            "thrust_to_weight": one.model.input_gain[2] / one.model.gravity_m_s2,
            "hover_thrust": one.model.hover_thrust,
            "lowest_ceiling_m": one.file.lowest_ceiling_m,
        }
        for one in found
    }
    width = max(map(len, document))
    lines = (f"{one.name:{width}}  {one.file.text}" for one in found)
    print_document(document, as_json, lambda _: "\n".join(lines))
