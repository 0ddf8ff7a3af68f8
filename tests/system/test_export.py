"""tessera-rig export, read back by the owner's own library where that is there: each must see points where
`tessera-rig project` says."""
import json
import pathlib
import sys

import cv2
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))
# Where `make export-peers` puts what is too large for every test run.
sys.path.append(str(ROOT / "build" / "deps" / "pycolmap"))
from solved import run  # noqa: E402

TURN = cv2.Rodrigues(np.array([0.05, -0.3, 0.1]))[0]
SHIFT_MM = np.array([-310.0, 12.0, 25.0])
LENSES = {
    "radtan": ("brown", [-0.28, 0.09, 4e-4, -3e-5, 0.0]),
    "brown": ("brown", [-0.28, 0.09, 4e-4, -3e-4, -0.012]),
    "rational": ("rational", [0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03]),
    "thin-prism": ("thin-prism", [0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03, 6e-4, -2e-4, -5e-4, 2e-4]),
    "fisheye": ("fisheye", [-0.03, 0.008, -0.004, 0.0007]),
}


def rig_file(path, lens):
    model, distortion = LENSES[lens]
    camera = {"width": 1920, "height": 1080, "model": model, "fx": 1400.5, "fy": 1402.25, "cx": 955.5,
              "cy": 543.25, "distortion": distortion}
    path.write_text(json.dumps({"format": "tessera-rig", "version": 1, "cameras": [
        {"name": "left", **camera, "cam_from_rig": {"rotation": np.eye(3).ravel().tolist(),
                                                    "translation_mm": [0, 0, 0]}},
        {"name": "right", **camera, "cam_from_rig": {"rotation": TURN.ravel().tolist(),
                                                     "translation_mm": SHIFT_MM.tolist()}}]}))
    return path


def export(tmp_path, lens, form, *options, expect=0):
    result = run("export", rig_file(tmp_path / "rig.json", lens), "--format", form, "--out", tmp_path / "out",
                 *options, expect=expect)
    assert expect == 0 or not (tmp_path / "out").exists()
    return tmp_path / "out" if expect == 0 else result.stderr


POINTS_MM = np.stack([a.ravel() for a in np.meshgrid(np.linspace(-700, 700, 9), np.linspace(-350, 350, 7),
                                                     [1200.0, 2500.0])], -1)


def pixels_of(tmp_path, points=POINTS_MM):
    """As `tessera-rig project` sees points in the camera frame."""
    text = "x,y,z\n" + "\n".join(",".join(map(repr, map(float, p))) for p in points) + "\n"
    out = run("project", tmp_path / "rig.json", "--camera", "right", stdin=text, expect=0).stdout
    return np.genfromtxt(out.splitlines()[1:], delimiter=",")


def opencv_pixels(matrix, distortion, fisheye):
    zero, d = np.zeros(3), np.array(distortion, float)
    if fisheye:
        return cv2.fisheye.projectPoints(POINTS_MM[None], zero, zero, matrix, d)[0].reshape(-1, 2)
    return cv2.projectPoints(POINTS_MM, zero, zero, matrix, d)[0].reshape(-1, 2)


# Double arithmetic on both sides, of numbers of some 1e3 written with all their digits.
SAME_PX = 1e-8


@pytest.mark.parametrize("lens, model", [("radtan", "plumb_bob"), ("brown", "plumb_bob"),
                                         ("rational", "rational_polynomial"), ("fisheye", "equidistant")])
def test_ros_camera_info_projects_alike(lens, model, tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML, which ROS reads camera_info with, is not installed")
    info = yaml.safe_load((export(tmp_path, lens, "ros") / "right.yaml").read_text())
    assert (info["image_width"], info["image_height"], info["camera_name"]) == (1920, 1080, "right")
    assert info["distortion_model"] == model
    d = info["distortion_coefficients"]
    assert d["cols"] == len(d["data"]) and all(isinstance(v, float) for v in d["data"])
    matrix = np.array(info["camera_matrix"]["data"]).reshape(3, 3)
    assert (np.array(info["projection_matrix"]["data"]).reshape(3, 4)[:, :3] == matrix).all()
    assert np.abs(opencv_pixels(matrix, d["data"], lens == "fisheye") - pixels_of(tmp_path)).max() < SAME_PX


@pytest.mark.parametrize("lens, model", [("radtan", "radtan"), ("fisheye", "equidistant")])
def test_kalibr_camchain_projects_alike_and_chains_poses_in_metres(lens, model, tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML, which Kalibr reads camchains with, is not installed")
    chain = yaml.safe_load(export(tmp_path, lens, "kalibr").read_text())
    assert list(chain) == ["cam0", "cam1"] and chain["cam1"]["rostopic"] == "/right/image_raw"
    camera = chain["cam1"]
    assert (camera["camera_model"], camera["distortion_model"]) == ("pinhole", model)
    assert camera["resolution"] == [1920, 1080] and camera["cam_overlaps"] == [0]
    fu, fv, pu, pv = camera["intrinsics"]
    matrix = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
    found = opencv_pixels(matrix, camera["distortion_coeffs"], lens == "fisheye")
    assert np.abs(found - pixels_of(tmp_path)).max() < SAME_PX
    pose = np.array(camera["T_cn_cnm1"])
    assert pose[:3, :3] == pytest.approx(TURN, abs=1e-15) and pose[3].tolist() == [0, 0, 0, 1]
    assert 1000 * pose[:3, 3] == pytest.approx(SHIFT_MM, abs=1e-10)


@pytest.mark.parametrize("lens", ["radtan", "brown", "rational", "thin-prism"])
def test_mrcal_reads_its_cameramodel_and_projects_alike(lens, tmp_path):
    mrcal = pytest.importorskip("mrcal", reason="mrcal is not installed (Debian: python3-mrcal)")
    model = mrcal.cameramodel(str(export(tmp_path, lens, "mrcal") / "right.cameramodel"))
    assert np.abs(mrcal.project(POINTS_MM, *model.intrinsics()) - pixels_of(tmp_path)).max() < SAME_PX
    assert tuple(model.imagersize()) == (1920, 1080)
    pose = model.extrinsics_Rt_fromref()
    # By way of the rotation vector and back.
    assert pose[:3] == pytest.approx(TURN, abs=1e-12) and 1000 * pose[3] == pytest.approx(SHIFT_MM, abs=1e-10)


@pytest.mark.parametrize("lens, model", [("radtan", "OPENCV"), ("brown", "FULL_OPENCV"),
                                         ("rational", "FULL_OPENCV"), ("fisheye", "OPENCV_FISHEYE")])
def test_colmap_reads_its_cameras_and_rig_and_projects_alike(lens, model, tmp_path):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not here (make export-peers fetches it)")
    out = export(tmp_path, lens, "colmap")
    for name in ("images.txt", "points3D.txt"):
        (out / name).write_text("")
    scene = pycolmap.Reconstruction()
    scene.read_text(out)
    rig, = pycolmap.read_rig_config(out / "rig_config.json")
    # Its pixels' origin is the corner of the first pixel.
    rays = POINTS_MM / POINTS_MM[:, 2:]
    known = pixels_of(tmp_path) + 0.5
    for camera in (scene.cameras[2], rig.cameras[1].camera):
        assert camera.model.name == model
        points = rays if hasattr(camera, "cam_from_img") else rays[:, :2]
        # COLMAP writes and projects in double precision too.
        assert np.abs(np.array([camera.img_from_cam(p) for p in points]).reshape(-1, 2) - known).max() < 1e-7
    assert (scene.cameras[2].width, scene.cameras[2].height) == (1920, 1080)
    assert [c.image_prefix for c in rig.cameras] == ["left/", "right/"]
    assert rig.cameras[0].ref_sensor and not rig.cameras[1].ref_sensor
    pose = rig.cameras[1].cam_from_rig
    assert pose.rotation.matrix() == pytest.approx(TURN, abs=1e-12)
    assert 1000 * pose.translation == pytest.approx(SHIFT_MM, abs=1e-10)


@pytest.mark.parametrize("lens", list(LENSES))
def test_opencv_yaml_projects_alike(lens, tmp_path):
    storage = cv2.FileStorage(str(export(tmp_path, lens, "opencv")), cv2.FILE_STORAGE_READ)
    node = storage.getNode("cameras").at(1)
    found = opencv_pixels(node.getNode("camera_matrix").mat(), node.getNode("distortion_coefficients").mat(),
                          lens == "fisheye")
    assert np.abs(found - pixels_of(tmp_path)).max() < SAME_PX


def test_json_is_the_rig_file_again(tmp_path):
    out = export(tmp_path, "thin-prism", "json")
    assert json.loads(out.read_text()) == json.loads((tmp_path / "rig.json").read_text())


@pytest.mark.parametrize("form, lens, words", [
    ("kalibr", "thin-prism", ["kalibr", "'left'", "px off", "--approximate"]),
    ("ros", "thin-prism", ["ros", "'left'", "px off", "--approximate"]),
    ("colmap", "thin-prism", ["colmap", "'left'", "px off", "--approximate"]),
    ("mrcal", "fisheye", ["mrcal", "'left'", "fisheye"]),
])
def test_a_lens_that_a_format_cannot_carry_is_refused_and_nothing_is_written(form, lens, words, tmp_path):
    complaint = export(tmp_path, lens, form, expect=1)
    assert len(complaint.splitlines()) == 1
    for word in words:
        assert word in complaint


def test_the_nearest_lens_is_as_far_off_as_the_note_says(tmp_path):
    yaml = pytest.importorskip("yaml", reason="PyYAML, which Kalibr reads camchains with, is not installed")
    rig = rig_file(tmp_path / "rig.json", "brown")
    result = run("export", rig, "--format", "kalibr", "--approximate", "--out", tmp_path / "out", expect=0)
    note = next(line for line in result.stderr.splitlines() if "'right'" in line)
    rms = float(note.split(" px off")[0].split()[-1])
    camera = yaml.safe_load((tmp_path / "out").read_text())["cam1"]
    fu, fv, pu, pv = camera["intrinsics"]
    y, x = np.mgrid[0:1079:31j, 0:1919:41j]
    text = "x,y\n" + "\n".join(f"{a},{b}" for a, b in zip(x.ravel(), y.ravel())) + "\n"
    out = run("unproject", rig, "--camera", "right", stdin=text, expect=0).stdout
    rays = np.genfromtxt(out.splitlines()[1:], delimiter=",")
    found = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]]),
                              np.array(camera["distortion_coeffs"]))[0].reshape(-1, 2)
    miss = np.sqrt(((found - np.stack([x, y], -1).reshape(-1, 2))**2).sum(axis=1).mean())
    # Another grid over the same image, and two digits in the note.
    assert miss == pytest.approx(rms, rel=0.1) and 0.0 < rms < 1.0
