"""A rig file whose template cannot be used is refused by `abs-service check`: file, key, value, the allowed values."""

import pytest

from abs_service import cli, config
from abs_service.supervision.exit_codes import Exit
from abs_service.tracker.detection.templates import sheet
from abs_service.tracking.preview import preview
from tests.abs_service.tracking.driving import default_plan, frame_set, rig_of, simulate


def rig_file(folder, template, model='{ type = "rigid" }', more=""):
    """The demo rig with a template, in a folder."""
    sensors = config.to_toml(config.load_default()).partition("[trackers")[0]
    text = f'{sensors}\n[trackers.toy]\nsensors = ["tof"]\nmodel = {model}\ntemplate = {template}\n{more}\n'
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    return folder / "rig.toml"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (('{ type = "sheet" }',), "trackers.toy.template.size: missing"),
        (('{ type = "sheet", size = [0.3, 0.0] }',), "trackers.toy.template.size[1] = 0.0: must be greater than 0"),
        (
            ('{ type = "mesh", path = "toy.obj", unit = "in" }',),
            "trackers.toy.template.unit = \"in\": must be 'm', 'cm'",
        ),
        (('{ type = "ball" }',), "no such type, allowed: first_image, mesh, sheet"),
        (('{ type = "mesh", path = "toy.obj" }',), "trackers.toy.template: path = "),
        (
            ('{ type = "sheet", size = [0.3, 0.2] }', '{ type = "gravity" }'),
            'the model "gravity" finds its object by itself',
        ),
        (
            ('{ type = "sheet", size = [0.3, 0.2] }', '{ type = "posed", shape = { type = "gravity" } }'),
            'the model "gravity" finds its object by itself',
        ),
        (
            ('{ type = "sheet", size = [0.3, 0.2] }', '{ type = "rigid" }', "reinitialization = { keep_s = 2.0 }"),
            "trackers.toy.reinitialization.keep_s = 2",
        ),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, capsys, arguments, message):
    path = rig_file(tmp_path, *arguments)
    assert cli.main(["check", str(path)]) == Exit.USER
    error = capsys.readouterr().err
    assert str(path) in error
    assert message in error


def test_the_simulated_sheet_is_found_by_its_size_and_drawn(tmp_path):
    path = rig_file(tmp_path, '{ type = "sheet", size = [0.2, 0.3] }', '{ type = "nurbs" }')
    assert cli.main(["check", str(path), "--picture", str(tmp_path / "first.png")]) == Exit.OK
    assert (tmp_path / "first.png").stat().st_size > 10_000
    simulation = simulate("simulated://sheet?seed=1")
    plan = default_plan(template=sheet.Settings((0.2, 0.3)))
    seen = preview([frame_set(simulation.expose(0)[0], 0)], rig_of(simulation), plan)
    assert seen.found is not None, seen.reason
    assert seen.found.extents == pytest.approx((0.3, 0.2, 0.0), abs=0.002)
