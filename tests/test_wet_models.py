"""What is wet in a model that no one here wrote, by `attach` and by the plugin; and what is said about it."""

import json
import warnings

import mujoco
import numpy as np
import pytest
import trimesh

import mjskip
from mjskip import Water, attach, register_plugin
from mjskip.cli import main
from mjskip.coupling.attach import Coupling
from mjskip.coupling.loading import load_model
from mjskip.coupling.selection import select
from mjskip.errors import MeshError, MjskipWarning, SceneError
from mjskip.hydro.solids import union

FLOATING = Water.floating()

ROBOT = """
<mujoco>
  <asset><mesh name="shell" inertia="shell" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2" face="0 2 1 0 1 3 1 2 3"/></asset>
  <worldbody>
    <body name="ball" pos="2 0 0"><freejoint/><geom name="ball" size=".1" density="500"/></body>
    <body name="frame" pos="0 0 -.05"><freejoint/>
      <body name="trunk" pos=".05 0 0" euler="0 0 20">
        <inertial pos=".01 0 0" mass="6" diaginertia=".05 .06 .07"/>
        <geom name="skin" type="mesh" mesh="shell" contype="0" conaffinity="0" group="2"/>
        <geom type="box" size=".2 .1 .05" group="3"/>
        <geom name="bump" type="sphere" pos=".2 0 0" size=".06" group="3"/>
        <body name="imu" pos="0 0 .06"><geom name="imu" type="box" size=".01 .01 .01" mass=".01"/></body>
        <body name="leg" pos=".1 .12 0"><joint axis="0 1 0"/>
          <geom name="thigh" type="capsule" fromto="0 0 0 0 0 -.2" size=".03" density="900"/>
          <body name="foot" pos="0 0 -.2"><geom name="foot" size=".035" density="900"/></body></body>
      </body>
    </body>
    <body name="arm" pos="0 3 0"><joint axis="0 1 0"/><geom name="vane" type="box" size=".1 .1 .01" pos=".1 0 0"/></body>
  </worldbody>
</mujoco>"""


@pytest.fixture
def robot():
    return mujoco.MjModel.from_xml_string(ROBOT)


def names(model, found):
    return {
        model.body(w.body).name: [model.geom(g).name or int(g) for g in w.geoms] for w in found.wet
    }


def id_of_the_box(model):
    return next(g for g in range(model.ngeom) if not model.geom(g).name)


def test_free_trees_are_wet_each_body_with_what_is_welded_to_it_by_its_colliding_geoms(robot):
    box = id_of_the_box(robot)
    found = select(robot)
    assert {b: set(g) for b, g in names(robot, found).items()} == {
        "ball": {"ball"},
        "frame": {"bump", "imu", box},
        "leg": {"thigh", "foot"},
    }
    assert [robot.body(b).name for b in found.wet[1].members] == ["frame", "trunk", "imu"]
    assert {robot.body(b).name: why for b, why in found.dry.items()} == {"arm": "not chosen"}
    left = found.wet[1].left_out
    assert left == {robot.geom("skin").id: "does not collide, others of its body do"}


def test_a_visual_twin_in_a_welded_body_is_left_out_as_one_in_the_same_body():
    twin = '<geom type="box" size=".12 .12 .12" contype="0" conaffinity="0" mass="0"/>'
    solid = '<geom name="solid" type="box" size=".1 .1 .1" density="300"/>'
    for inside in (
        solid + twin,
        f"{solid}<body>{twin}</body>",
        f"<body>{twin}</body><body>{solid}</body>",
    ):
        model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody><body><freejoint/>{inside}</body></worldbody></mujoco>"
        )
        with attach(model, water=FLOATING) as coupling:
            assert coupling.hulls[0].volume == pytest.approx(0.008)


def test_a_body_that_follows_a_mocap_frame_is_not_moved_by_water():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='hand' mocap='true'><geom size='.1'/></body>"
        "<body><freejoint/><geom size='.1' density='300'/></body></worldbody></mujoco>"
    )
    with pytest.raises(SceneError, match="'hand' is fixed to the world"):
        attach(model, bodies="hand", water=FLOATING)


def test_flat_parts_of_a_mesh_displace_nothing_and_stop_nothing():
    """Two sheets of four triangles each, closed and without volume, beside a box: as in scans of hands."""
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    sheet = trimesh.Trimesh(
        [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 1]], process=False
    )
    sheets = [sheet.copy().apply_translation([0.3 + 0.2 * k, 0, 0]) for k in range(2)]
    assert union([box, *sheets]).volume == pytest.approx(0.008)
    with pytest.raises(MeshError, match="flat"):
        union(sheets)


RULES = [
    ({"bodies": "all"}, {"ball", "frame", "leg", "arm"}),
    ({"bodies": "leg"}, {"leg"}),
    ({"bodies": ["leg", "ball"]}, {"leg", "ball"}),
    ({"bodies": [1]}, {"ball"}),
    ({"bodies": np.array([1])}, {"ball"}),
    ({"bodies": ["trunk"]}, {"trunk"}),
    ({"bodies": "group 3"}, {"frame"}),
    ({"bodies": lambda model, body: model.body(body).name == "arm"}, {"arm"}),
]


@pytest.mark.parametrize(("rule", "wet"), RULES)
def test_bodies_are_chosen_by_name_id_group_or_predicate(robot, rule, wet):
    assert set(names(robot, select(robot, **rule))) == wet


GEOM_RULES = [
    ("all", {"skin", "box", "bump", "imu"}),
    ("collision", {"box", "bump", "imu"}),
    ("group 2", {"skin"}),
    ("group 2 3", {"skin", "box", "bump"}),
    ("bump", {"bump"}),
    (["bump", "skin"], {"bump", "skin"}),
    (lambda model, geom: model.geom_group[geom] == 3, {"box", "bump"}),
]


@pytest.mark.parametrize(("rule", "wet"), GEOM_RULES)
def test_geoms_are_chosen_by_name_id_group_or_predicate(robot, rule, wet):
    found = select(robot, "frame", rule).wet[0].geoms
    assert {robot.geom(g).name or "box" for g in found} == wet


def test_a_geom_without_a_name_is_chosen_by_id(robot):
    box = id_of_the_box(robot)
    assert select(robot, "frame", [box]).wet[0].geoms == (box,)


REFUSALS = [
    ({"bodies": "boat"}, SceneError, "no body named 'boat'"),
    ({"bodies": [99]}, SceneError, "no body 99: ids of bodies go from 1 to"),
    ({"bodies": []}, ValueError, "bodies is empty"),
    ({"bodies": 1.5}, ValueError, "bodies is 1.5: give names or ids"),
    ({"bodies": [True]}, ValueError, "bodies is"),
    ({"bodies": "group x"}, ValueError, 'as in "group 3"'),
    ({"bodies": "group 5"}, SceneError, "no body that moves has a geom of group"),
    ({"bodies": lambda model, body: False}, SceneError, "chooses no body"),
    ({"geoms": ["hat"]}, SceneError, "no geom 'hat' on these bodies: their geoms are ball"),
    ({"geoms": "group 4"}, SceneError, "no geom for water to act on"),
]


@pytest.mark.parametrize(("rule", "kind", "message"), REFUSALS)
def test_what_cannot_be_chosen_is_refused_in_one_line(robot, rule, kind, message):
    with pytest.raises(kind, match=message) as refused:
        attach(robot, **rule)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("what", [None, "duck.xml", {}, 3])
def test_what_is_no_model_is_refused_by_name(what):
    with pytest.raises(ValueError, match=r"^model is .*: give what mujoco"):
        attach(what)


def test_a_model_without_a_free_tree_is_told_of_all():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(SceneError, match='bodies="all" takes every one that moves'):
        attach(model)
    attach(model, bodies="all", water=FLOATING).close()


def test_the_force_on_welded_bodies_acts_at_their_common_centre(robot):
    """On the frame, which has no mass of its own; seen by what it does to the whole tree."""
    data = mujoco.MjData(robot)
    data.qvel[:] = np.random.default_rng(0).normal(size=robot.nv)
    mujoco.mj_forward(robot, data)
    with attach(robot, data, water=FLOATING) as coupling:
        mujoco.mj_forward(robot, data)
        found = coupling.wrench(data, "frame")
        assert coupling.wrench(data, "imu").force.tolist() == found.force.tolist()
        frame, k = robot.body("frame").id, coupling.bodies.index(robot.body("frame").id)
        force, torque = data.xfrc_applied[frame, :3], data.xfrc_applied[frame, 3:]
        arm = coupling.centre(data, k) - data.xipos[frame]
        np.testing.assert_allclose(force, found.force + found.air_force, rtol=1e-12)
        about = found.torque + found.air_torque + np.cross(arm, force)
        np.testing.assert_allclose(torque, about, rtol=1e-10, atol=1e-12)
        each = coupling.wrenches(data)
        total = coupling.tree_wrench(data, "leg")
        np.testing.assert_allclose(total.force, each["frame"].force + each["leg"].force, rtol=1e-12)
        held = coupling.hydrostatics(data, "leg")
        assert held.wetted_area == pytest.approx(total.wetted_area, rel=1e-9)


# --- the plugin says the same ------------------------------------------------------------------------

PRESET = '<config key="preset" value="floating"/>'
PLUGIN = """<extension><plugin plugin="mjskip.water"><instance name="w">
  {}</instance></plugin></extension>"""


def plugged(config=None, carrier="frame"):
    register_plugin()
    config = {"preset": "floating"} | (config or {})
    keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in config.items())
    text = ROBOT.replace("<mujoco>", "<mujoco>" + PLUGIN.format(keys), 1)
    where = f'<body name="{carrier}"'
    head, tail = text.split(where, 1)
    tail = (
        tail.replace("<freejoint/>", '<freejoint/><plugin instance="w"/>', 1)
        if carrier in ("frame", "ball")
        else (tail.replace(">", '><plugin instance="w"/>', 1))
    )
    return mujoco.MjModel.from_xml_string(head + where + tail)


SAME = [
    ({}, {}, "frame", ["frame", "leg"]),
    ({"geoms": "group 3"}, {"geoms": "group 3"}, "frame", ["frame"]),
    ({"geoms": "collision"}, {"geoms": "collision"}, "frame", ["frame", "leg"]),
    ({"geoms": "bump thigh"}, {"geoms": ["bump", "thigh"]}, "frame", ["frame", "leg"]),
    ({"bodies": "this"}, {}, "frame", ["frame"]),
    (
        {"resolution": "8", "max_faces": "100"},
        {"resolution": 8, "max_faces": 100},
        "frame",
        ["frame", "leg"],
    ),
    ({"interior": "convex"}, {"interior": "convex"}, "frame", ["frame", "leg"]),
    ({}, {}, "leg", ["leg"]),
]


@pytest.mark.parametrize(("config", "options", "carrier", "bodies"), SAME)
def test_the_plugin_moves_a_robot_as_attach_does(robot, config, options, carrier, bodies):
    model = plugged(config, carrier)
    ours, theirs = mujoco.MjData(robot), mujoco.MjData(model)
    for data in (ours, theirs):
        data.qvel[:] = np.random.default_rng(1).normal(size=robot.nv)
    with attach(robot, ours, water=FLOATING, bodies=bodies, **options):
        mujoco.mj_step(robot, ours, nstep=100)
    mujoco.mj_step(model, theirs, nstep=100)
    np.testing.assert_allclose(theirs.qpos, ours.qpos, rtol=0, atol=1e-10)
    dry = mujoco.MjData(robot)
    dry.qvel[:] = np.random.default_rng(1).normal(size=robot.nv)
    mujoco.mj_step(robot, dry, nstep=100)
    assert np.abs(dry.qpos - ours.qpos).max() > 1e-4


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ({"preset": "diving"}, "preset is 'diving': use one of floating"),
        ({"bodies": "some"}, "bodies is 'some': use one of tree, this"),
        ({"geoms": "hat"}, "no geom 'hat'"),
        ({"geoms": "group 9"}, "group"),
        ({"resolution": "fine"}, "resolution is 'fine': give a whole number"),
        ({"interior": "dry"}, "interior is 'dry'"),
    ],
)
def test_a_bad_key_of_the_plugin_is_a_compile_error_that_names_it(config, says):
    with pytest.raises(ValueError, match=says):
        plugged(config)


def test_a_sensor_of_the_plugin_shows_every_wet_body_in_turn():
    register_plugin()
    text = ROBOT.replace("<mujoco>", "<mujoco>" + PLUGIN.format(PRESET), 1).replace(
        '<body name="frame" pos="0 0 -.05"><freejoint/>',
        '<body name="frame" pos="0 0 -.05"><freejoint/><plugin instance="w"/>',
    )
    text = text.replace("</mujoco>", '<sensor><plugin name="s" instance="w"/></sensor></mujoco>')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    readings = data.sensordata.reshape(-1, 7)
    coupling = Coupling(model, None, FLOATING, bodies=["frame", "leg"])
    for reading, body in zip(readings, ("frame", "leg"), strict=True):
        found = coupling.wrench(data, body)
        np.testing.assert_allclose(reading[:3], found.force + found.air_force, rtol=1e-10)
        assert reading[6] == pytest.approx(found.wetted_area)


# --- what MuJoCo's compiler would not survive --------------------------------------------------------

BODY = '<body><freejoint/>{}<geom size=".05" density="500"/></body>'
TWICE = '<replicate count="2" offset="1 0 0">{}</replicate>'
EXTENSION = '<extension><plugin plugin="mjskip.water"><instance name="w"/></plugin></extension>'
SENSOR = '<sensor><plugin name="s" instance="w"/></sensor>'


def replicated(worldbody, rest=""):
    return f"<mujoco>{EXTENSION}<worldbody>{worldbody}</worldbody>{rest}</mujoco>"


def test_copies_of_an_instance_are_refused_before_they_end_the_process(tmp_path):
    carrier = BODY.format('<plugin instance="w"/>')
    file = tmp_path / "m.xml"
    for text in (
        replicated(TWICE.format(carrier)),
        replicated(f"<replicate count='1'>{TWICE.format(f'<frame>{carrier}</frame>')}</replicate>"),
        replicated(TWICE.format('<geom size=".1"/>') + carrier, SENSOR),
    ):
        file.write_text(text)
        with pytest.raises(SceneError, match=r"<replicate> ends MuJoCo's compiler: write"):
            load_model(file)
        with pytest.raises(SceneError, match="<replicate>"):
            mjskip.load_scene(file)


def test_copies_in_an_included_file_are_refused_too(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "raft.xml").write_text(
        "<mujoco>" + TWICE.format(BODY.format('<plugin instance="w"/>')) + "</mujoco>"
    )
    main_file = tmp_path / "main.xml"
    main_file.write_text(replicated('<include file="parts/raft.xml"/>'))
    with pytest.raises(SceneError, match=r'<plugin plugin="mjskip.water"> <config'):
        load_model(main_file)


def test_what_is_written_instead_is_wet(tmp_path):
    own = BODY.format(
        '<plugin plugin="mjskip.water"><config key="preset" value="floating"/></plugin>'
    )
    file = tmp_path / "m.xml"
    file.write_text(
        f'<mujoco><extension><plugin plugin="mjskip.water"/></extension><worldbody>{TWICE.format(own)}</worldbody></mujoco>'
    )
    model = load_model(file)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (data.qfrc_passive.reshape(-1, 6)[:, 2] > 1.0).all()


# --- what is said ------------------------------------------------------------------------------------


def test_the_report_says_what_is_wet_and_why_and_what_counts_twice(robot):
    report = Coupling(robot, None, FLOATING).report()
    text = str(report)
    for part in (
        "left out: skin does not collide", "arm: dry, not chosen", "frame with trunk, imu",
        "overlap of frame and leg", "tree of frame: 6.7", "tree of ball", "cost: ",
    ):  # fmt: skip
        assert part in text, text
    ball = next(t for t in report.trees if t.name == "ball")
    assert ball.draft == pytest.approx(0.1, rel=0.06)  # half immersed; vertices stand out
    assert report.step_ratio > 1.0
    assert json.loads(json.dumps(report.to_dict()))["bodies"][0]["name"] == "ball"


def test_the_overlap_of_a_report_is_that_of_the_solids():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body name="a"><freejoint/>
      <geom type="box" size=".1 .1 .1"/><body name="b" pos=".15 0 0"><joint/><geom type="box" size=".1 .1 .1"/>
      </body></body></worldbody></mujoco>""")
    report = Coupling(model, None, FLOATING).report()
    assert report.overlaps == {"a and b": pytest.approx(0.05 * 0.2 * 0.2, rel=1e-9)}
    assert report.trees[0].union == pytest.approx(2 * 0.008 - 0.002, rel=1e-9)


def test_inspect_prints_the_report_of_a_file(tmp_path, capsys):
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT)
    for arguments in ([], ["--bodies", "all", "--geoms", "collision"], ["--json"]):
        with pytest.raises(SystemExit) as left:
            main(["inspect", str(file), *arguments])
        assert left.value.code == 0
    printed = capsys.readouterr().out
    found = json.loads(printed.splitlines()[-1])
    assert {body["name"] for body in found["bodies"]} == {"ball", "frame", "leg", "arm"}
    assert "sinks" in printed or "floats at draft" in printed
    with pytest.raises(SystemExit) as left:
        main(["inspect", str(tmp_path / "none.xml")])
    assert left.value.code == 2


def test_inspect_reads_a_shipped_scene_as_its_plugin_makes_it(capsys):
    with pytest.raises(SystemExit):
        main(["inspect", str(mjskip.load_scene("boat").path), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["trees"][0]["flotation"] == "floats"
    assert abs(found["trees"][0]["heel"]) < 0.01


CONCAVE = """<mujoco><asset><mesh name="m" {inertia} vertex="{vertex}" face="{face}"/></asset><worldbody>
  <body name="b"><freejoint/><geom name="ring" type="mesh" mesh="m" density="600"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("inertia", ["", 'inertia="convex"', 'inertia="exact"'])
def test_a_concave_mesh_whose_mass_is_not_its_volumes_is_doubted(inertia):
    import trimesh

    ring = trimesh.creation.torus(0.3, 0.1, major_sections=20, minor_sections=10)
    model = mujoco.MjModel.from_xml_string(
        CONCAVE.format(
            inertia=inertia,
            vertex=" ".join(f"{v:.7g}" for v in ring.vertices.ravel()),
            face=" ".join(map(str, ring.faces.ravel())),
        )
    )
    found = [d for d in Coupling(model, None, FLOATING).warnings if "inertia=" in d]
    off = abs(model.body_mass[1] / (600 * ring.volume) - 1.0) > 0.02
    assert off == ("exact" not in inertia)
    assert bool(found) == off


DOUBTFUL = [
    ('<option density="1000"/>', 'density="900"', "MuJoCo's own medium .*beside water"),
    ('<option viscosity=".1"/>', 'density="900"', "set both to 0"),
]


@pytest.mark.parametrize(("option", "density", "says"), DOUBTFUL)
@pytest.mark.parametrize("route", ["attach", "plugin"])
def test_mujocos_own_medium_beside_our_water_is_doubted(option, density, says, route):
    plugin = route == "plugin"
    register_plugin()
    extension = '<extension><plugin plugin="mjskip.water"/></extension>' if plugin else ""
    own = (
        '<plugin plugin="mjskip.water"><config key="preset" value="floating"/></plugin>'
        if plugin
        else ""
    )
    text = f"<mujoco>{option}{extension}<worldbody><body name='medium {route} {says[:6]}'><freejoint/>{own}<geom size='.0{len(says)}' {density}/></body></worldbody></mujoco>"
    if plugin:
        with pytest.warns(MjskipWarning, match=says):
            mujoco.MjModel.from_xml_string(text)
    else:
        model = mujoco.MjModel.from_xml_string(text)
        with pytest.warns(MjskipWarning, match=says):
            attach(model, water=FLOATING).close()


def test_what_is_lighter_than_water_that_does_not_bear_is_doubted_and_told_of_floating():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='boat'><freejoint/><geom size='.1' density='300'/></body></worldbody></mujoco>"
    )
    with pytest.warns(
        MjskipWarning, match=r"'boat' of 1\.257 kg displaces 4\.189 kg .*Water\.floating"
    ):
        attach(model).close()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        attach(model, water=FLOATING).close()
