# SPDX-License-Identifier: Apache-2.0
"""Docstrings, stubs, the page of docs."""

import doctest
import importlib.util
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import bilayer

SOURCE = Path(__file__).resolve().parents[2]
PACKAGE = Path(bilayer.__file__).parent


def documented():
    """All public functions, classes and methods with their names."""
    for name in bilayer.__all__:
        value = getattr(bilayer, name)
        yield name, value
        if inspect.isclass(value) and value.__module__.startswith("bilayer"):
            for member, inner in vars(value).items():
                if not member.startswith("_"):
                    yield f"{name}.{member}", inner


def texts():
    yield "bilayer", bilayer.__doc__
    for name, value in documented():
        text = value.__func__.__doc__ if isinstance(value, staticmethod) else value.__doc__
        if text and ">>>" in text:
            yield name, text


def test_everything_public_has_a_docstring():
    missing = [name for name, value in documented() if not (value.__doc__ or name == "__version__")]
    assert missing == []


@pytest.mark.parametrize("name, text", list(texts()), ids=[name for name, _ in texts()])
def test_docstrings(name, text):
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    runner = doctest.DocTestRunner()
    report = []
    runner.run(test, out=report.append)
    assert runner.failures == 0, "".join(report)


def test_the_functions_have_examples():
    names = {name for name, _ in texts()}
    functions = {name for name, value in documented() if inspect.isroutine(value) or isinstance(value, staticmethod)}
    results = {name.split(".")[0] for name in functions if hasattr(getattr(bilayer, name.split(".")[0]), "_fields")}
    assert {name for name in functions if name.split(".")[0] not in results} - names == set()


def test_stubs_name_what_is_there():
    stub = (PACKAGE / "_bilayer.pyi").read_text()
    native = bilayer._bilayer
    for name, value in vars(native).items():
        if name.startswith("_") and name != "__version__":
            continue
        assert re.search(rf"^(def|class) {name}\b|^{name}:", stub, re.M), f"no stub of {name}"
        if inspect.isclass(value) and not issubclass(value, Exception):
            body = re.search(rf"^class {name}:\n((?: .*\n|\n)*)", stub, re.M).group(1)
            stubbed = set(re.findall(r"^    def (\w+)", body, re.M))
            actual = {key for key in vars(value) if not key.startswith("_")}
            assert {key for key in stubbed if not key.startswith("_")} == actual, name


def test_mypy(tmp_path):
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed")
    user = tmp_path / "user.py"
    user.write_text(
        "import numpy as np\n"
        "import bilayer\n"
        "field = bilayer.Field(bilayer.build(bilayer.box(), resolution=8), bilayer.box())\n"
        "distance, gradient, in_band = field.sample(np.zeros((4, 3)))\n"
        "reveal_type(distance)\n"
        "reveal_type(bilayer.read_mesh('a.obj').faces)\n"
        "bilayer.build(bilayer.box(), resolutoin=3)\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", str(tmp_path / "cache")]
    environment = {"MYPYPATH": str(PACKAGE.parent), "PATH": "/usr/bin:/bin"}
    result = subprocess.run(command + ["-p", "bilayer"], capture_output=True, text=True, env=environment)
    assert result.returncode == 0, result.stdout + result.stderr
    result = subprocess.run(command + [str(user)], capture_output=True, text=True, env=environment)
    assert "floating[numpy._typing._32Bit]" in result.stdout
    assert "unsignedinteger[numpy._typing._32Bit]" in result.stdout
    assert 'Unexpected keyword argument "resolutoin"' in result.stdout
    assert result.stdout.count("error:") == 1, result.stdout


def test_the_committed_reference():
    script = SOURCE / "docs" / "python_reference.py"
    environment = {"PYTHONPATH": str(PACKAGE.parent), "PATH": "/usr/bin:/bin"}
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert result.stdout == (SOURCE / "docs" / "python-reference.md").read_text(), f"write it anew by {script.name}"


def test_the_page_works(tmp_path, monkeypatch):
    page = (SOURCE / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.S)
    assert len(blocks) >= 5 and len(blocks[0].strip().splitlines()) == 5
    monkeypatch.chdir(tmp_path)
    bilayer.sphere(1).save("bunny.ply")
    names = {}
    for block in blocks:
        if "# needs" in block:  # a package that is not ours
            package = re.search(r"# needs (\w+)", block).group(1)
            if importlib.util.find_spec(package) is None:
                continue
        exec(compile(block, "docs/python.md", "exec"), names)
