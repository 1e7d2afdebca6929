"""Promises of every control of the page in a real browser."""

import numpy as np
import pytest
from msgspec.structs import replace
from support.browsing import (
    DESKTOP,
    IN_A_BROWSER,
    SIZES,
    Browse,
    Vehicles,
    fly,
    requests_of,
    row_of,
    selected,
)
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink
from rcopterx.bus.requests import Fly, Follow, GoTo, Tune

pytestmark = IN_A_BROWSER


@SIZES
def test_take_off_and_land_do_what_they_say(
    browse: Browse, vehicles: Vehicles, size: tuple[int, int]
) -> None:
    window = browse(size)
    window.get_by_role("button", name="Take off").click()
    wait_for(lambda: all(vehicle.phase == "flying" for vehicle in vehicles.values()), "not flying", 30.0)
    window.locator("#sentence", has_text="2 fly").wait_for()
    window.get_by_role("button", name="Land", exact=True).click()
    wait_for(lambda: all(vehicle.phase == "ground" for vehicle in vehicles.values()), "not landed", 30.0)
    window.locator(".notice", has_text="landed").wait_for()


@SIZES
def test_a_vehicle_gets_another_leader_and_controller_and_lands_by_its_panel(
    browse: Browse, vehicles: Vehicles, size: tuple[int, int]
) -> None:
    fly(vehicles)
    window = browse(size)
    panel = selected(window, "h2")
    panel.locator("[name=leader]").select_option("h1")
    wait_for(lambda: bool(requests_of(vehicles["h2"], Follow)), "does not follow", 30.0)
    row_of(window, "h2").locator("td", has_text="h1").wait_for()
    panel.locator("[name=leader]").select_option("")
    wait_for(lambda: "Lead" in vehicles["h2"].verbs, "does not lead", 30.0)
    panel.locator("[name=controller]").select_option("lqr")
    wait_for(lambda: bool(requests_of(vehicles["h2"], Tune)), "not tuned", 30.0)
    assert requests_of(vehicles["h2"], Tune)[0].controller == "lqr"
    panel.get_by_role("button", name="Land it").click()
    wait_for(lambda: "Land" in vehicles["h2"].verbs, "does not land", 30.0)
    assert "Land" not in vehicles["h1"].verbs


def test_a_typed_set_point_is_flown_to_and_not_overwritten_while_it_is_typed(
    browse: Browse, vehicles: Vehicles
) -> None:
    fly(vehicles)
    window = browse(DESKTOP)
    panel = selected(window, "h1")
    panel.locator("[name=x]").fill("0.3")
    vehicles["h1"].set_point = replace(vehicles["h1"].set_point, position_m=(0.9, 0.9, 0.9))
    window.wait_for_timeout(700)
    assert panel.locator("[name=x]").input_value() == "0.3"
    for name, value in (("y", "-0.2"), ("z", "1.1"), ("heading", "90")):
        panel.locator(f"[name={name}]").fill(value)
    panel.get_by_role("button", name="Go to").click()
    wait_for(lambda: bool(requests_of(vehicles["h1"], GoTo)), "does not go", 30.0)
    set_point = requests_of(vehicles["h1"], GoTo)[0].set_point
    assert set_point.position_m == pytest.approx((0.3, -0.2, 1.1))
    assert set_point.yaw_rad == pytest.approx(np.pi / 2)


def test_weights_are_applied_and_undone_by_their_buttons(browse: Browse, vehicles: Vehicles) -> None:
    vehicles["h1"].diagnostics["controller"] = "cascade"
    fly(vehicles)
    window = browse(DESKTOP)
    panel = selected(window, "h1")
    window.locator("#tune > summary").click()
    panel.locator("[data-group=position]").fill("1")
    panel.get_by_text("× 2", exact=True).wait_for()
    panel.get_by_role("button", name="Apply").click()
    wait_for(lambda: len(requests_of(vehicles["h1"], Tune)) == 1, "not tuned", 60.0)
    panel.get_by_role("button", name="Undo").click()
    wait_for(lambda: len(requests_of(vehicles["h1"], Tune)) == 2, "not undone", 60.0)
    wait_for(lambda: panel.locator("[data-group=position]").input_value() == "0", "slider stays", 30.0)


def test_a_formation_is_flown_and_a_leader_promoted_by_their_buttons(
    browse: Browse, vehicles: Vehicles
) -> None:
    fly(vehicles)
    window = browse(DESKTOP)
    formation = window.locator("#formation")
    formation.locator("summary").click()
    formation.locator("[name=shape]").select_option("column")
    formation.locator("[name=spacing]").fill("0.7")
    formation.get_by_role("button", name="Fly this formation").click()
    wait_for(lambda: bool(requests_of(vehicles["h2"], Follow)), "does not follow", 30.0)
    assert requests_of(vehicles["h2"], Follow)[0].following[0].offset_m == pytest.approx((-0.7, 0.0, 0.0))
    vehicles["h2"].refusals["lead"] = vehicles["h1"].refusals["follow"] = "not now"
    formation.locator("[name=leader]").select_option("h2")
    formation.get_by_role("button", name="Promote").click()
    window.locator(".notice.refused").wait_for(timeout=30_000)


def test_waypoints_are_clicked_in_the_scene_flown_and_cleared(browse: Browse, vehicles: Vehicles) -> None:
    fly(vehicles)
    window = browse(DESKTOP)
    path = window.locator("#path")
    path.locator("summary").click()
    path.get_by_role("button", name="Fly through them").click()
    window.locator(".notice.refused", has_text="click waypoints").wait_for(timeout=30_000)
    path.get_by_text("click waypoints").click()
    window.get_by_role("button", name="Top", exact=True).click()
    canvas = window.locator("#stage canvas")
    box = canvas.bounding_box()
    for dx in (-40, 40):
        canvas.click(position={"x": box["width"] / 2 + dx, "y": box["height"] / 2})
    path.get_by_role("button", name="Fly through them").click()
    wait_for(lambda: bool(requests_of(vehicles["h1"], Fly)), "does not fly", 30.0)
    path.get_by_role("button", name="Clear").click()
    path.get_by_role("button", name="Fly through them").click()
    window.wait_for_timeout(500)
    assert len(requests_of(vehicles["h1"], Fly)) == 1


@pytest.mark.parametrize(("kind", "moved"), [(".handle:not(.lift)", (0, 1)), (".handle.lift", (2,))])
def test_handles_are_large_win_over_the_camera_and_move_their_vehicle(
    browse: Browse, vehicles: Vehicles, kind: str, moved: tuple[int, ...]
) -> None:
    fly(vehicles)
    before = vehicles["h1"].set_point.position_m
    window = browse(DESKTOP)
    handle = window.locator(f"{kind}[data-vehicle=h1]")
    handle.wait_for(timeout=30_000)
    box = handle.bounding_box()
    assert min(box["width"], box["height"]) >= 24.0
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    window.mouse.move(x, y)
    window.mouse.down()
    window.mouse.move(x + 10, y - 25, steps=5)
    assert requests_of(vehicles["h1"], GoTo) == [], "the hand holds it"
    window.mouse.up()
    wait_for(lambda: bool(requests_of(vehicles["h1"], GoTo)), "does not go", 30.0)
    after = requests_of(vehicles["h1"], GoTo)[0].set_point.position_m
    for axis in range(3):
        changed = abs(after[axis] - before[axis]) > 0.02
        assert changed or axis not in moved
        assert not changed or axis in moved
    window.wait_for_timeout(300)
    now = handle.bounding_box()
    assert abs(now["x"] - box["x"]) < 15, "the camera has moved, too"


def test_a_followers_handle_changes_its_offset(browse: Browse, vehicles: Vehicles) -> None:
    fly(vehicles)
    link = LeaderLink(leader="h1", offset_m=(0.5, 0.0, 0.0))
    vehicles["h2"].following = vehicles["h2"].assigned = (link,)
    window = browse(DESKTOP)
    window.locator(".handle.lift[data-vehicle=h2]").drag_to(
        window.locator("#stage canvas"), target_position={"x": 500, "y": 100}
    )
    wait_for(lambda: bool(requests_of(vehicles["h2"], Follow)), "does not follow", 30.0)
    assert requests_of(vehicles["h2"], Follow)[0].following[0].offset_m[2] > 0.1


def test_pausing_stops_the_strip_and_scrubbing_shows_the_past(browse: Browse, vehicles: Vehicles) -> None:
    fly(vehicles)
    window = browse(DESKTOP)
    window.wait_for_timeout(2500)
    strip = window.locator("#time")
    strip.get_by_role("button", name="Pause").click()
    strip.locator("[name=scrub]").fill("5")
    assert "−" in strip.locator("output").inner_text()
    window.locator(".handle[data-vehicle=h1]").first.wait_for(state="hidden")
    strip.get_by_role("button", name="Live").click()
    assert strip.locator("output").inner_text() == "live"
    window.locator(".handle[data-vehicle=h1]").first.wait_for(state="visible")


def test_any_signal_can_be_added_to_the_plots_and_removed(browse: Browse) -> None:
    window = browse(DESKTOP)
    strip = window.locator("#time")
    strip.locator("[name=signal]").select_option("thrust")
    plot = strip.locator(".plot", has_text="thrust stick")
    plot.wait_for()
    plot.get_by_role("button").click()
    plot.wait_for(state="detached")
    assert strip.locator(".plot").count() == 2


def test_a_vehicle_is_selected_by_key_and_by_a_click_in_the_scene(browse: Browse, vehicles: Vehicles) -> None:
    window = browse(DESKTOP)
    window.keyboard.press("2")
    window.locator("#selected h2", has_text="h2").wait_for()
    row_of(window, "h2").click()
    window.locator("#selected").wait_for(state="hidden")


def test_views_and_options_of_the_scene_can_be_chosen(browse: Browse, vehicles: Vehicles) -> None:
    vehicles["h1"].diagnostics |= {"wind_m_s2": (0.5, 0.5), "position_deviation_m": (0.001, 0.001, 0.001)}
    fly(vehicles)
    window = browse(DESKTOP)
    canvas = window.locator("#stage canvas")
    pictures = {canvas.screenshot()}
    for act in (
        lambda: window.get_by_role("button", name="Top", exact=True).click(),
        lambda: window.get_by_label("wind").check(),
        lambda: window.get_by_label("uncertainty").check(),
        lambda: window.keyboard.press("s"),
        lambda: window.mouse.wheel(0, -300),
    ):
        window.mouse.move(800, 300)
        act()
        window.wait_for_timeout(400)
        picture = canvas.screenshot()
        assert picture not in pictures
        pictures.add(picture)
