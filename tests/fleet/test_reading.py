"""Promises of the fleet file: what is wrong is refused as a whole, with the path of the field."""

import os
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.fleet.formation_check import formation_places
from rcopterx.fleet.reading import load_fleet, merged, parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.vehicle_types import type_of

ONE = 'name = "lab"\n[vehicles.h1]\nsubject = "a"\ntransmitter = { port = "p" }\n'


def test_a_fleet_needs_little_and_the_rest_has_defaults() -> None:
    fleet = parse_fleet(ONE)
    assert fleet.simulator is None
    assert list(fleet.hosts) == ["main"]
    assert list(fleet.gateways) == ["transmitters"]
    assert fleet.vehicles["h1"].type == "coaxial"
    assert fleet.vehicles["h1"].host == fleet.tracker.host == "main"
    assert fleet.bus.namespace is None


def test_defaults_are_laid_under_every_vehicle_deeply() -> None:
    fleet = parse_fleet(
        PAIR
        + """
control = { horizon = 20, settings = { time_limit_s = 0.01 } }
[defaults]
type = "quadrotor"
[defaults.control]
controller = "cascade"
horizon = 30
settings = { terminal_cost = true, time_limit_s = 0.02 }
[defaults.transmitter]
protocol = "dsmp"
"""
    )
    h1, h2 = fleet.vehicles["h1"], fleet.vehicles["h2"]
    assert (h1.type, h2.type) == ("quadrotor", "quadrotor")
    assert (h1.control.controller, h1.control.horizon) == ("cascade", 30)
    assert (h2.control.controller, h2.control.horizon) == ("cascade", 20)
    assert h1.control.settings == {"terminal_cost": True, "time_limit_s": 0.02}
    assert h2.control.settings == {"terminal_cost": True, "time_limit_s": 0.01}
    assert (h2.transmitter.protocol, h2.transmitter.port) == ("dsmp", "radio-h2")


tables = st.recursive(
    st.integers(), lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3), max_leaves=8
).filter(lambda value: isinstance(value, dict))


@given(tables, tables)
def test_merging_keeps_every_value_and_the_upper_table_wins(base: dict, over: dict) -> None:
    result = merged(base, over)
    assert result.keys() == base.keys() | over.keys()
    for key, value in over.items():
        if not (isinstance(value, dict) and isinstance(base.get(key), dict)):
            assert result[key] == value
    assert merged(base, {}) == base
    assert merged({}, over) == over


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = [", "not TOML"),
        ("", "name"),
        ('name = "lab"', "vehicles"),
        ('name = "lab"\n[vehicles]', "vehicles: at least one"),
        ('name = "Lab 1"\n' + ONE.split("\n", 1)[1], "name: expected"),
        ('name = "lab"\nvehicles = [1]', "vehicles: expected"),
        (ONE + "[vehicles.h1]", "not TOML"),
        ("x = " + 5000 * "[" + 5000 * "]", "nested more than 16 times"),
        ("x = " + 100 * "[" + 100 * "]", r"x\[0\].*: nested more than 16 times"),
        (".".join(5000 * "x") + " = 1", r"x\.x.*: nested more than 16 times"),
        (ONE + 'type = "quadrotor"\ntype = "coaxial"', "not TOML"),
        (ONE + "[colour]", "colour"),
        (ONE + 'colour = "red"', r"vehicles\.h1.*colour"),
        (ONE + "control = { horizon = 1.5 }", r"vehicles\.h1\.control\.horizon: expected"),
        (ONE + 'control = { horizon = "50" }', r"vehicles\.h1\.control\.horizon: expected"),
        (ONE + "control = { horizon = 1 }", r"vehicles\.h1\.control\.horizon: expected"),
        (ONE + "control = { horizn = 20 }", r"vehicles\.h1\.control.*horizn"),
        (ONE + "control = 3", r"vehicles\.h1\.control: expected"),
        (ONE + "host = 3", r"vehicles\.h1\.host: expected"),
        (ONE.replace('subject = "a"\n', ""), r"vehicles\.h1.*subject"),
        (ONE.replace('"a"', '""'), r"vehicles\.h1\.subject"),
        (ONE.replace('"p"', '""'), r"vehicles\.h1\.transmitter\.port"),
        (ONE.replace('"p"', '"p", protocol = "infrared"'), r"vehicles\.h1\.transmitter\.protocol"),
        (ONE.replace('"p"', '"p", model_match = 64'), r"vehicles\.h1\.transmitter\.model_match"),
        (ONE.replace("vehicles.h1", "vehicles.H1"), "vehicles"),
        (ONE.replace("vehicles.h1", "vehicles.tracker"), r"vehicles\.tracker: the name is reserved"),
        (ONE.replace("vehicles.h1", "vehicles.fleet"), r"vehicles\.fleet: the name is reserved"),
        (ONE + "[gateways.router]", r"gateways\.router: the name is reserved"),
        (ONE + "[gateways.checkpoint]", r"gateways\.checkpoint: the name is reserved"),
        (ONE + "[gateways.host_service]", r"gateways\.host_service: the name is reserved"),
        (ONE + "[gateways.script]", r"gateways\.script: the name is reserved"),
        (ONE + "[bus]\nrealtime_priority = 99", r"bus\.realtime_priority"),
        (
            ONE + '[hosts.main]\naddress = "lab-münchen"',
            r"hosts\.main\.address: 'lab-münchen' must be in ASCII",
        ),
        (ONE + 'type = "a\\u0000.toml"', r"vehicles\.h1\.type: contains the character NUL"),
        (ONE + '[bus]\nnamespace = "a/b"', r"bus\.namespace"),
        (ONE + "[hosts.main]\nrouter_port = 0", r"hosts\.main\.router_port"),
        (ONE + "[volume]\nmax_m = [1, 1, -1]", r"volume\.max_m\[2\]"),
        (ONE + "[volume]\nmax_m = [1, 1]", r"volume\.max_m: expected"),
        (ONE + "[volume]\nmin_m = [-inf, -1, 0]", r"volume\.min_m\[0\]: -inf is not a finite number"),
        (ONE + '[tracker]\nhost = "lab2"', r"tracker\.host: unknown host 'lab2', known are main"),
        (ONE + 'host = "lab2"', r"vehicles\.h1\.host: unknown host 'lab2', known are main"),
        (ONE + '[gateways.transmitters]\nhost = "x"', r"gateways\.transmitters\.host: unknown host 'x'"),
        (ONE + '[simulator]\nhost = "x"', r"simulator\.host: unknown host 'x'"),
        (ONE + "[simulator]\nrate_hz = 1000", r"simulator\.rate_hz"),
        (ONE + "[simulator]\nrate_hz = nan", r"simulator\.rate_hz: nan is not a finite number"),
        (ONE + '[simulator]\nprofile = "tracker9"', r"simulator\.profile"),
        (ONE + "[simulator.start]\nh1 = [0, 0, 0]", r"^simulator\.start\.h1: expected"),
        (ONE + "[tracker.settings]\nport = 1", r"^tracker\.settings\.port: expected"),
        (ONE + "[types]\nmine = 1", r"^types\.mine: expected"),
        (ONE + "[simulator.start]\nh7 = [0, 0, 0, 0]", r"simulator\.start\.h7: unknown vehicle"),
        (
            ONE.replace('"p"', '"p", gateway = "roof"'),
            r"vehicles\.h1\.transmitter\.gateway: unknown gateway 'roof', known are transmitters",
        ),
        (ONE + "defaults = 3", "defaults"),
        ("defaults = 3\n" + ONE, "defaults: must be a table"),
        (ONE + "[defaults.control]\nhorizn = 3", r"vehicles\.h1\.control.*horizn"),
    ],
)
def test_a_wrong_field_is_refused_by_its_path(text: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        parse_fleet(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            PAIR.replace('"heli2"', '"heli1"'),
            r"vehicles\.h2\.subject: 'heli1' is already that of vehicles\.h1",
        ),
        (PAIR.replace("radio-h2", "radio-h1"), r"vehicles\.h2\.transmitter\.port: 'radio-h1' is already"),
        (PAIR.replace("radio-h2", "./radio-h1"), r"vehicles\.h2\.transmitter\.port: './radio-h1' is already"),
        (PAIR + "[vehicles.h1]\n", r"not TOML"),
        (
            PAIR + "[hosts.main]\n[hosts.second]\n",
            r"hosts\.second\.router_port: '127\.0\.0\.1:7447' is already",
        ),
        (PAIR + '[tracker]\naddress = "127.0.0.1:7447"', r"tracker\.address: 127\.0\.0\.1:7447 is already"),
    ],
)
def test_what_must_be_unique_is_refused_the_second_time(text: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        parse_fleet(text)


def following(**leaders: str) -> str:
    """Fleet file of vehicles with the leaders they follow, separated by blanks."""
    tables = []
    for name, line in leaders.items():
        links = ", ".join(f'{{ leader = "{leader}", offset_m = [1, 0, 0] }}' for leader in line.split())
        tables.append(
            f'[vehicles.{name}]\nsubject = "{name}"\ntransmitter = {{ port = "{name}" }}\nfollow = [{links}]'
        )
    return "\n".join(['name = "lab"', *tables])


@pytest.mark.parametrize(
    ("leaders", "words"),
    [
        ({"a": "b"}, r"vehicles\.a\.follow\[0\]\.leader: unknown vehicle 'b', known are a"),
        ({"a": "", "b": "a c"}, r"vehicles\.b\.follow\[1\]\.leader: unknown vehicle 'c'"),
        ({"a": "", "b": "a a"}, r"vehicles\.b\.follow\[1\]\.leader: 'a' is named twice"),
        ({"a": "a"}, r"vehicles\.a\.follow\[0\]\.leader: a cannot follow itself"),
        ({"a": "b", "b": "a"}, r"vehicles\.a\.follow: a cycle of leaders: a -> b -> a"),
        ({"a": "", "b": "a d", "c": "b", "d": "c"}, r"vehicles\.b\.follow: a cycle.*: b -> d -> c -> b"),
    ],
)
def test_wrong_leaders_are_refused_by_the_path_of_the_link(leaders: dict[str, str], words: str) -> None:
    with pytest.raises(FleetError, match=words):
        parse_fleet(following(**leaders))


@pytest.mark.parametrize("field", ["offset_m = [nan, 0, 0]", "offset_m = [0, 0, 0], weight = inf"])
def test_links_with_numbers_that_are_not_finite_are_refused(field: str) -> None:
    with pytest.raises(FleetError, match=r"vehicles\.h2\.follow\[0\]\.\w+(\[0\])?: (nan|inf)"):
        parse_fleet(PAIR.replace("offset_m = [-0.4, 0.5, 0.0]", field))


@given(st.dictionaries(st.sampled_from("abcdef"), st.sets(st.sampled_from("abcdef")), min_size=1))
def test_a_file_is_refused_exactly_when_its_leaders_form_a_cycle(graph: dict[str, set[str]]) -> None:
    graph = {name: leaders & graph.keys() for name, leaders in graph.items()}

    def reaches(start: str, goal: str) -> bool:
        seen: set[str] = set()
        stack = list(graph[start])
        while stack:
            name = stack.pop()
            if name not in seen:
                seen.add(name)
                stack += graph[name]
        return goal in seen

    text = following(**{name: " ".join(sorted(leaders)) for name, leaders in graph.items()})
    if any(reaches(name, name) for name in graph):
        with pytest.raises(FleetError, match="cycle"):
            parse_fleet(text)
    else:
        assert parse_fleet(text).vehicles.keys() == graph.keys()


def test_places_in_the_formation_add_up_along_the_line_of_leaders() -> None:
    fleet = parse_fleet(following(a="", b="a", c="b"))
    found = formation_places(fleet)
    assert [found[name].tolist() for name in "abc"] == [[x, 0.0, 0.0, 0.0] for x in (0.0, 1.0, 2.0)]


def test_simulated_radios_must_be_on_the_simulators_host() -> None:
    hosts = '[hosts.main]\n[hosts.second]\naddress = "127.0.0.2"\n[gateways.transmitters]\nhost = "second"\n'
    with pytest.raises(FleetError, match=r"gateways\.transmitters\.host: simulated radios are on .* 'main'"):
        parse_fleet(PAIR + hosts)
    assert parse_fleet(HARDWARE_PAIR + hosts).gateways["transmitters"].host == "second"


@pytest.mark.parametrize("address", ["0.0.0.0", "192.168.0.10", "::", "lab-pc", "10.0.0.1"])
def test_an_address_others_reach_needs_certificates_or_the_word_insecure(address: str) -> None:
    text = PAIR + f'[hosts.main]\naddress = "{address}"\n'
    with pytest.raises(FleetError, match=r"^hosts\.main\.address: .* insecure = true"):
        parse_fleet(text)
    assert parse_fleet(text + "[security]\ninsecure = true").endpoint("main").startswith("tcp/")
    secured = parse_fleet(text + '[security]\ncertificates = "/etc/rcopterx"')
    assert secured.endpoint("main").startswith("tls/")


@pytest.mark.parametrize("address", ["127.0.0.1", "127.3.2.1", "::1", "localhost"])
def test_an_address_only_this_computer_reaches_needs_no_certificates(address: str) -> None:
    assert parse_fleet(PAIR + f'[hosts.main]\naddress = "{address}"').security.certificates is None


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('certificates = "certs"', "security.certificates: 'certs' must be an absolute path"),
        ('certificates = "~nobody_here/c"', "security.certificates: '~nobody_here/c' must be an absolute"),
        ('certificates = "/a"\ninsecure = true', "security.insecure: true, but there are certificates"),
        ('operators = ["a", "b", "a"]', "security.operators[2]: 'a' is named twice"),
    ],
)
def test_contradictions_about_access_are_refused(table: str, message: str) -> None:
    with pytest.raises(FleetError, match=re.escape(message)):
        parse_fleet(f"{PAIR}[security]\n{table}")


@pytest.mark.parametrize("path", ["~nobody_here/c", "~root/c", "~"])
def test_files_in_the_home_directory_of_a_named_user_are_refused(path: str) -> None:
    for table, field in (("log", "directory"), ("tracker", "record_raw")):
        with pytest.raises(FleetError, match=rf"^{table}\.{field}: '{path}': .* must begin with ~/"):
            parse_fleet(f'{PAIR}[{table}]\n{field} = "{path}"')
        parse_fleet(f'{PAIR}[{table}]\n{field} = "~/c"')


@pytest.mark.parametrize("field", ["[log]\ndirectory", "[tracker]\nrecord_raw", "[security]\ncertificates"])
def test_files_below_the_home_directory_of_a_user_without_one_are_refused(
    field: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    with pytest.raises(FleetError, match=r"'~/c': this user has no home directory, give an absolute path"):
        parse_fleet(f'{PAIR}{field} = "~/c"')


def test_a_type_file_may_be_below_the_home_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "small.toml").write_text('text = "small"\nbase = "coaxial"\n')
    assert type_of(parse_fleet(ONE + 'type = "~/small.toml"\n'), "h1").name == "small"


def test_errors_of_a_file_begin_with_its_path(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    with pytest.raises(FleetError, match=re.escape(f"{path}: cannot be read")):
        load_fleet(path)
    with pytest.raises(FleetError, match=re.escape(f"{tmp_path}: cannot be read")):
        load_fleet(tmp_path)
    path.write_bytes(b'name = "\xff"')
    with pytest.raises(FleetError, match=re.escape(f"{path}: not UTF-8 text")):
        load_fleet(path)
    path.write_text('name = "lab"')
    with pytest.raises(FleetError, match=re.escape(f"{path}: ")):
        load_fleet(path)
    path.write_text(PAIR)
    assert list(load_fleet(path).vehicles) == ["h1", "h2"]


@pytest.mark.parametrize(
    ("text", "listens"),
    [
        (ONE, False),
        (ONE + "[hosts.main]\nrouter_port = 7448", True),
        (ONE + '[hosts.main]\naddress = "192.0.2.7"\n[security]\ninsecure = true', True),
        (ONE + '[security]\ncertificates = "~/certificates"', True),
        (PAIR + '[hosts.main]\n[hosts.roof]\naddress = "127.0.0.2"', True),
    ],
)
def test_router_listens_for_others_only_if_there_are_others(text: str, listens: bool) -> None:
    assert parse_fleet(text).listens("main") is listens


def test_a_fleet_file_reads_the_same_whatever_program_has_written_it(tmp_path: Path) -> None:
    marked = Path(__file__).parents[1] / "fixtures" / "text_files" / "bom.toml"
    plain, windows = tmp_path / "plain.toml", tmp_path / "windows.toml"
    plain.write_bytes(marked.read_bytes().removeprefix(b"\xef\xbb\xbf"))
    windows.write_bytes(marked.read_bytes().replace(b"\n", b"\r\n"))
    assert load_fleet(marked) == load_fleet(plain) == load_fleet(windows)


def test_a_decimal_comma_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_bytes(b'\xef\xbb\xbfname = "lab"\r\n\r\n[simulator]\r\nrate_hz = 0,5\r\n')
    with pytest.raises(FleetError, match=r"at line 4, column .*; numbers have a decimal point"):
        load_fleet(path)
