"""Rules of zenoh's access control: topics that a client may publish and query, by its certificate's common name.

The router enforces them (https://zenoh.io/docs/manual/access-control). Everything else is denied.
"""

from collections.abc import Mapping

from abs_service.bus import keys

#: Of the host whose process listens; `run` and its processes share its certificate, so it may do everything.
RIG = "rig"

#: What each of the others publishes and answers queries for, as topics.
PUBLISHES: Mapping[str, tuple[str, ...]] = {
    "capture": (
        *(keys.image("*", "*"), keys.points(keys.image("*", "*"))),
        *(topic("*") for topic in (keys.calibration, keys.model, keys.truth, keys.clock, keys.controls)),
        *(keys.TRANSFORMS, keys.CONFIG, keys.SCHEMA),
        *(keys.health("capture"), keys.live("capture")),
    ),
    "tracker": (
        *(topic("*") for topic in (keys.state, keys.mesh, keys.theta, keys.scene, keys.topology, keys.reinitialize)),
        keys.state("*") + "/@adv/**",  # history for late joiners
        *(keys.health("track/*"), keys.live("track/*")),
    ),
    "recorder": (keys.RECORD, keys.health("record"), keys.live("record")),
    "viewer": (keys.health("view"),),
    "operator": (keys.health("view"),),
}

#: Those that may subscribe and query; capture needs nothing from others.
READERS = ("tracker", "recorder", "viewer", "operator")
#: Those that may send commands.
COMMANDERS = ("operator",)
#: Every name that a certificate may have.
NAMES = (RIG, *PUBLISHES)

#: Topics of commands.
_COMMANDS = (keys.reinitialize("*"), keys.controls("*"), keys.RECORD, keys.RELOAD)

_READ = ("declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query")
_PUBLISH = ("put", "declare_queryable", "reply", "liveliness_token")
#: `**` does not match what begins with @.
_EVERYTHING = ("**", "**/@adv/**")


def access_control() -> dict[str, object]:
    """The `access_control` of a router's zenoh configuration."""
    rules = [
        _rule("deliver", "egress", (*_READ, *_PUBLISH), _EVERYTHING),
        _rule("everything", "ingress", (*_READ, *_PUBLISH), _EVERYTHING),
        _rule("read", "ingress", _READ, _EVERYTHING),
        # A denial goes before what allows the same. Queries with wildcards are no commands, see `answer_commands`.
        _rule("no commands", "ingress", ("query",), _COMMANDS, "deny"),
        *(_rule(f"publish {name}", "ingress", _PUBLISH, topics) for name, topics in PUBLISHES.items() if topics),
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in NAMES],
        "policies": [{"subjects": [name], "rules": _rules_of(name)} for name in NAMES],
    }


def _rules_of(name: str) -> list[str]:
    if name == RIG:
        return ["deliver", "everything"]
    given = ["deliver", "read"] if name in READERS else ["deliver"]
    return [
        *given,
        *([] if name in COMMANDERS else ["no commands"]),
        *([f"publish {name}"] if PUBLISHES[name] else []),
    ]


def _rule(
    identifier: str, flow: str, messages: tuple[str, ...], topics: tuple[str, ...], permission: str = "allow"
) -> dict[str, object]:
    return {
        "id": identifier,
        "permission": permission,
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": [keys.key("*", topic) for topic in topics],
    }
