"""The documents: links resolve, tables are whole, files they name exist, and their examples run."""

import re
import subprocess
import tomllib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*.md")])
EVERY = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))


def blocks(text: str, language: str) -> list[str]:
    """The code blocks of a document in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def prose(text: str) -> str:
    """A document without its code blocks."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(path: Path) -> set[str]:
    """The fragments that links into a document may have: those of its headings, as GitHub makes them, and its own."""
    text = prose(path.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain} | set(re.findall(r'<a id="([^"]+)">', text))


def sources() -> set[str]:
    """Names of all files under version control."""
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode != 0:
        pytest.skip("not a checkout: its files are not known")
    return set(listing.stdout.splitlines())


@EVERY
def test_links_resolve(path):
    text = prose(path.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http:", "https:", "mailto:")):
            continue
        file, _, fragment = target.partition("#")
        linked = (path.parent / file).resolve() if file else path
        assert linked.exists(), target
        if fragment:
            assert fragment in anchors(linked), target


@EVERY
def test_rows_have_the_cells_of_their_tables(path):
    cells = None
    for number, line in enumerate(prose(path.read_text(encoding="utf-8")).splitlines(), 1):
        if not line.startswith("|"):
            cells = None
            continue
        found = len(re.findall(r"(?<!\\)\|", line))
        cells = cells or found
        assert found == cells and line.endswith("|"), f"row {number}: {line}"


@EVERY
def test_files_that_are_named_exist(path):
    known = sources()
    names = {Path(file).name for file in known}
    for span in re.findall(r"`([^`\n]+)`", path.read_text(encoding="utf-8")):
        for module in re.findall(r"python -m (validation[\w.]*)", span):
            place = module.replace(".", "/")
            assert {f"{place}.py", f"{place}/__main__.py"} & known, span
        if re.fullmatch(r"[\w/.]+\.(rs|py)", span):
            assert span in known or span in names, span


def test_readme_example_runs(monkeypatch, capsys):
    pytest.importorskip("pliant")
    (example,) = blocks((ROOT / "README.md").read_text(encoding="utf-8"), "python")
    (promised,) = re.findall(r"# ([\d.]+) m per N·m²", example)
    monkeypatch.chdir(ROOT)
    exec(compile(example, "README.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(float(promised), abs=0.05)


def test_python_page_example_runs(monkeypatch, capsys):
    pytest.importorskip("pliant")
    example, _, _, own_force = blocks((ROOT / "docs" / "python.md").read_text(encoding="utf-8"), "python")
    (promised,) = re.findall(r"# heights of node 5 differ by ([\d.]+) m", example)
    monkeypatch.chdir(ROOT)
    exec(compile(example, "docs/python.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(float(promised), rel=0.05)
    (promised,) = re.findall(r"# (-?[\d.]+) rad per N·m·s/rad", own_force)
    exec(compile(own_force, "docs/python.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(float(promised), rel=5e-3)


def test_python_page_example_of_many_diagnoses_runs(monkeypatch, tmp_path, capsys):
    pytest.importorskip("pliant")
    _, many, cluster, _ = blocks((ROOT / "docs" / "python.md").read_text(encoding="utf-8"), "python")
    # its scenes are not there, which ends as an answer for each; `test_many.py` diagnoses scenes, on a cluster too
    monkeypatch.chdir(tmp_path)
    exec(compile(many, "docs/python.md", "exec"), {})
    told = capsys.readouterr().out
    assert [name in told for name in ("a/scene.toml", "b/scene.toml")] == [True, True] and told.count("cannot be read") == 2
    compile(cluster, "docs/python.md", "exec")


def test_perception_page_example_runs(capsys):
    pytest.importorskip("pliant")
    pytest.importorskip("skimage")
    (example,) = blocks((ROOT / "docs" / "perception.md").read_text(encoding="utf-8"), "python")
    ((nodes, metres),) = re.findall(r"# (\d+) nodes are seen; the ends are ([\d.]+) m apart", example)
    exec(compile(example, "docs/perception.md", "exec"), {})
    seen, apart = capsys.readouterr().out.split()
    assert (seen, float(apart)) == (nodes, pytest.approx(float(metres), abs=5e-4))


def test_logs_page_example_runs(monkeypatch, tmp_path, capsys):
    pytest.importorskip("pliant")
    (example,) = blocks((ROOT / "docs" / "logs.md").read_text(encoding="utf-8"), "python")
    (promised,) = re.findall(r"# (time_s .*)", example)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "docs/logs.md", "exec"), {})
    assert capsys.readouterr().out.strip() == promised
    assert (tmp_path / "csv" / "run.csv").is_file()


def test_control_page_example_runs(monkeypatch, tmp_path, capsys):
    pytest.importorskip("pliant")
    text = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    (example, by_readings), (scene, task, *_) = blocks(text, "python"), blocks(text, "toml")
    (tmp_path / "lift.toml").write_text(scene, encoding="utf-8")
    (tmp_path / "task.toml").write_text(task, encoding="utf-8")
    (promised,) = re.findall(r"whose end is ([\d.]+) m from its goal", example)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(example, "docs/control.md", "exec"), names)
    first, second = capsys.readouterr().out.splitlines()
    exec(compile(by_readings, "docs/control.md", "exec"), names)
    assert float(capsys.readouterr().out) < 0.01  # ten times the noise of a reading
    held, away = first.split()
    assert (held, float(away)) == ("True", pytest.approx(float(promised), abs=1e-4))
    assert second.endswith("[]")


@EVERY
def test_toml_is_toml(path):
    for block in blocks(path.read_text(encoding="utf-8"), "toml"):
        assert tomllib.loads(block)


@EVERY
def test_whole_scenes_can_be_stepped(path):
    pliant = pytest.importorskip("pliant")
    for block in blocks(path.read_text(encoding="utf-8"), "toml"):
        if block.startswith("schema_version"):
            model = pliant.loads(block)
            roll = model.rollout(model.initial_state(), model.controls(3), record=False)
            assert np.isfinite(roll.x).all()


def test_the_checks_see_what_they_are_for(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# A page, of *two* parts\n\n[gone](other.md), [no part](#parts)\n", encoding="utf-8")
    assert anchors(page) == {"a-page-of-two-parts"}
    with pytest.raises(AssertionError, match="other"):
        test_links_resolve(page)
    page.write_text("# Parts\n\n[a part](#parts), [none](#three)\n\n| a | b |\n|---|---|\n| 1 | |x| |\n", encoding="utf-8")
    with pytest.raises(AssertionError, match="three"):
        test_links_resolve(page)
    with pytest.raises(AssertionError, match="row 7"):
        test_rows_have_the_cells_of_their_tables(page)
    page.write_text("see `no_such_file.rs`", encoding="utf-8")
    with pytest.raises(AssertionError, match="no_such_file"):
        test_files_that_are_named_exist(page)
