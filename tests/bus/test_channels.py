"""Promises of the channel and request tables: one row each, consistent, and enough to build every key."""

import inspect

import msgspec
import pytest

from rcopterx.bus import (
    channels,
    external_messages,
    host_messages,
    intent,
    log_messages,
    messages,
    requests,
)
from rcopterx.bus.channels import CHANNELS, Channel
from rcopterx.bus.message import SCHEMA_VERSION, InvalidMessageError, Message
from rcopterx.bus.requests import VERBS, Reply, Request, verb_of
from rcopterx.transmitter_gateway.inputs import State

PRIORITIES = (channels.REAL_TIME, channels.INTERACTIVE_HIGH, channels.DATA_HIGH, channels.DATA_LOW)
rows = pytest.mark.parametrize("channel", CHANNELS, ids=lambda channel: f"{channel.unit}-{channel.topic}")


def test_no_two_channels_share_a_key() -> None:
    keys = [(channel.unit, channel.topic) for channel in CHANNELS]
    assert len(set(keys)) == len(keys)


def test_no_two_channels_carry_the_same_message() -> None:
    assert len({channel.message for channel in CHANNELS}) == len(CHANNELS)


def test_every_channel_of_the_module_is_a_row_of_the_table() -> None:
    declared = {id(value) for value in vars(channels).values() if isinstance(value, Channel)}
    assert declared == {id(channel) for channel in CHANNELS}


def test_every_message_travels_on_a_channel() -> None:
    declared = {
        kind
        for module in (messages, external_messages, host_messages, log_messages, intent)
        for _, kind in inspect.getmembers(module, inspect.isclass)
        if issubclass(kind, Message) and kind is not Message
    }
    assert declared == {channel.message for channel in CHANNELS}


@rows
def test_every_message_type_states_its_schema_version(channel: Channel[Message]) -> None:
    fields = {field.name: field.default for field in msgspec.structs.fields(channel.message)}
    assert fields["schema_version"] == SCHEMA_VERSION


@rows
def test_the_encoding_names_topic_and_version(channel: Channel[Message]) -> None:
    assert channel.encoding == f"application/msgpack;rcopterx.{channel.topic}.v{SCHEMA_VERSION}"


@rows
def test_figures_of_a_channel_make_sense(channel: Channel[Message]) -> None:
    assert channel.priority in PRIORITIES
    assert channel.rate_hz >= 0
    # A sender that keeps its rate must never count as silent for one lost message.
    assert channel.rate_hz == 0 or channel.stale_after_s >= 2 / channel.rate_hz
    assert channel.message.__doc__
    assert channel.publisher


@rows
def test_topics_are_one_chunk_of_a_key(channel: Channel[Message]) -> None:
    assert channel.topic.isidentifier()
    assert channel.topic == channel.topic.lower()


def test_keys_are_fleet_unit_topic() -> None:
    assert channels.key("lab", "h1", "pose") == "rcopterx/lab/h1/pose"
    assert channels.request_key("lab", "h1", "land") == "rcopterx/lab/h1/request/land"


def test_every_request_of_the_module_is_a_verb_and_the_other_way_round() -> None:
    declared = {
        kind
        for _, kind in inspect.getmembers(requests, inspect.isclass)
        if issubclass(kind, Request) and kind is not Request
    }
    assert declared == {verb.request for verb in VERBS.values()}
    assert len(VERBS) == len(declared)


@pytest.mark.parametrize("verb", VERBS.values(), ids=lambda verb: verb.name)
def test_every_verb_has_a_server_and_a_reply(verb: requests.Verb) -> None:
    assert verb.server in ("agent", "transmitter_gateway", "launcher", "router", "simulator")
    assert issubclass(verb.reply, Reply)
    assert VERBS[verb.name] is verb


def test_a_type_outside_the_table_is_no_request() -> None:
    with pytest.raises(InvalidMessageError, match="Request is not a request of the table"):
        verb_of(Request)


@pytest.mark.parametrize("state", State)
def test_every_state_of_the_arbiter_can_travel(state: State) -> None:
    assert msgspec.convert(state.value.lower(), messages.ArbiterState) == state.value.lower()
