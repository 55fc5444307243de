# SPDX-License-Identifier: Apache-2.0
"""Docstrings, stubs, the page of docs."""

import ast
import doctest
import importlib.util
import inspect
import pickle
import pydoc
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


def written(name, text):
    """What a docstring says beyond what Python writes by itself: a signature, or the number of a field."""
    text = inspect.cleandoc(text or "")
    own = re.sub(rf"\A{name}\(.*\n?", "", text)
    return own if len(re.findall(r"[A-Za-z]{2,}", own)) >= 2 and "Alias for field number" not in own else ""


def test_everything_public_has_a_docstring_of_its_own():
    missing = [name for name, value in documented() if name != "__version__" and not written(name.split(".")[-1], value.__doc__)]
    assert missing == []
    inherited = [name for name, value in documented() if inspect.isclass(value) and value.__doc__ == value.__base__.__doc__]
    assert inherited == []
    assert bilayer.Samples.gradient.__doc__ == "float32 (..., 3), of length near 1; zero outside the band."
    assert bilayer.BodyDistance.position_b.__doc__ == "float32 (3,), the closest points."


@pytest.mark.parametrize("name, text", list(texts()), ids=[name for name, _ in texts()])
def test_docstrings(name, text, request, monkeypatch):
    if "box_tiles" in text:
        monkeypatch.chdir(request.getfixturevalue("folder_with_tiles"))
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


def signatures():
    """All public functions and constructors that take arguments, and their docstrings."""
    for name, value in documented():
        if inspect.isclass(value) and "__signature__" in vars(value):
            yield name, inspect.signature(value), value.__doc__
        elif inspect.isroutine(value) or isinstance(value, staticmethod):
            if not hasattr(getattr(bilayer, name.split(".")[0]), "_fields"):
                function = getattr(value, "__func__", value)
                yield name, inspect.signature(function), function.__doc__


def test_functions_say_what_they_raise():
    taking = {name: doc for name, signature, doc in signatures() if set(signature.parameters) - {"self"}}
    assert len(taking) > 40
    raising = re.compile(r"^(.* )?Raises ", re.M)
    assert [name for name, doc in taking.items() if not raising.search(doc)] == []


def test_result_classes_describe_each_field():
    kinds = [value for _, value in documented() if hasattr(value, "_fields") or hasattr(value, "__dataclass_fields__")]
    assert len(kinds) >= 11
    for kind in kinds:
        fields = getattr(kind, "_fields", None) or list(kind.__dataclass_fields__)
        described = re.findall(r"(\w+(?:, \w+)*): (?:float|int|bool|uint|str|Pose|BodyDistance|LevelSet)", kind.__doc__)
        assert set(fields) == {name for names in described for name in names.split(", ")}, kind.__name__


def parameters_of_stub(function):
    """Names, kinds and defaults, as inspect names them; None for a default of `...`."""
    arguments = function.args
    positional = list(zip(arguments.args, [...] * (len(arguments.args) - len(arguments.defaults)) + arguments.defaults))
    named = list(zip(arguments.kwonlyargs, [... if value is None else value for value in arguments.kw_defaults]))
    for kind, group in (("POSITIONAL_OR_KEYWORD", positional), ("KEYWORD_ONLY", named)):
        for argument, default in group:
            empty = default is ... or (isinstance(default, ast.Constant) and default.value is ...)
            yield argument.arg, kind, default is ..., None if empty else ast.literal_eval(default)


def test_stubs_have_the_signatures_of_the_functions():
    checked = 0
    stub = ast.parse((PACKAGE / "_bilayer.pyi").read_text())
    functions = [("", one) for one in stub.body if isinstance(one, ast.FunctionDef)]
    for kind in stub.body:
        if isinstance(kind, ast.ClassDef) and hasattr(bilayer, kind.name):
            functions += [(kind.name, one) for one in kind.body if isinstance(one, ast.FunctionDef)]
    for owner, function in functions:
        decorators = {ast.unparse(one) for one in function.decorator_list}
        if "property" in decorators or (function.name.startswith("__") and function.name != "__init__"):
            continue
        if function.name == "__init__":
            value = getattr(bilayer, owner)
        else:
            value = vars(getattr(bilayer, owner))[function.name] if owner else getattr(bilayer, function.name)
        actual = inspect.signature(getattr(value, "__func__", value)).parameters
        stubbed = [one for one in parameters_of_stub(function) if function.name != "__init__" or one[0] != "self"]
        for name, kind, required, default in stubbed:
            there = actual[name]
            assert there.kind.name == kind, (owner, function.name, name)
            if "overload" not in decorators or name not in ("resolution", "voxel_size"):
                assert (there.default is inspect.Parameter.empty) == required, (owner, function.name, name)
                assert default is None or there.default == default, (owner, function.name, name)
        assert [one[0] for one in stubbed] == list(actual), (owner, function.name)
        checked += 1
    assert checked > 50


def test_tracebacks_show_no_unfinished_object(box_set):
    for make in (lambda: bilayer.Field(3), lambda: bilayer.Mesh(1, 2), lambda: bilayer.Pose((1,))):
        with pytest.raises(ValueError) as caught:
            make()
        frames = [entry.frame.raw for entry in caught.traceback]
        seen = [value for frame in frames for value in frame.f_locals.values()]
        assert seen and not any(isinstance(value, (bilayer.Field, bilayer.Mesh, bilayer.Pose)) for value in seen)
    with pytest.raises(TypeError, match=r"Field\(\) missing 1 required positional argument: 'level_set'"):
        bilayer.Field()
    with pytest.raises(TypeError, match=r"Field\(\) got an unexpected keyword argument 'stroage'"):
        bilayer.Field(box_set, stroage="fixed16")


def test_help_shows_arguments():
    assert str(inspect.signature(bilayer.Field.sample)) == "(self, points)"
    assert str(inspect.signature(bilayer.Field)) == "(level_set, mesh=None, storage='float32', keep_level_set=True)"
    assert "resolution=None, voxel_size=None" in str(inspect.signature(bilayer.build))
    assert pickle.loads(pickle.dumps(bilayer.Shape.sphere))(1) is not None
    assert "closest(self, points, max_distance=inf)" in pydoc.plain(pydoc.render_doc(bilayer.Field.closest))


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
        "from typing import Optional\n"
        "import numpy as np\n"
        "import bilayer\n"
        "field = bilayer.Field(bilayer.build(bilayer.box(), resolution=8), bilayer.box())\n"
        "distance, gradient, in_band = field.sample(np.zeros((4, 3)))\n"
        "reveal_type(distance)\n"
        "reveal_type(bilayer.read_mesh('a.obj').faces)\n"
        "bilayer.distances([], np.zeros((3, 4, 4)), [[0, 1]])\n"
        "bilayer.mass_properties((np.zeros((3, 3)), [[0, 1, 2]]))\n"
        "width: Optional[float] = 3\n"
        "bilayer.build([[[0, 0, 0]], [[0, 0, 0]]], resolution=width, half_width_voxels=np.float32(3))\n"
        "bilayer.build(bilayer.box(), voxel_size=np.int64(1), threads=np.int32(1))\n"
        "body = bilayer.Collider(bilayer.box(), bilayer.build(bilayer.box(), resolution=8))\n"
        "bilayer.distances((body for _ in range(2)), (bilayer.Pose() for _ in range(2)), [[0, 1]])\n"
        "bilayer.LevelSet()  # wrong\n"
        "bilayer.Shape()  # wrong\n"
        "bilayer.Obstacle()  # wrong\n"
        "bilayer.build(bilayer.box(), resolutoin=3)  # wrong\n"
        "bilayer.build(bilayer.box())  # wrong\n"
        "bilayer.build(bilayer.box(), resolution=3, voxel_size=1)  # wrong\n"
        "bilayer.build(bilayer.box(), resolution=3, method='best')  # wrong\n"
        "bilayer.build(3, resolution=3)  # wrong\n"
        "bilayer.Field(bilayer.build(bilayer.box(), resolution=3), storage='float64')  # wrong\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", str(tmp_path / "cache")]
    environment = {"MYPYPATH": str(PACKAGE.parent), "PATH": "/usr/bin:/bin"}
    result = subprocess.run(command + ["-p", "bilayer"], capture_output=True, text=True, env=environment)
    assert result.returncode == 0, result.stdout + result.stderr
    result = subprocess.run(command + [str(user)], capture_output=True, text=True, env=environment)
    assert "floating[numpy._typing._32Bit]" in result.stdout
    assert "unsignedinteger[numpy._typing._32Bit]" in result.stdout
    lines = user.read_text().splitlines()
    wrong = [number for number, line in enumerate(lines, 1) if "# wrong" in line]
    assert len(wrong) == 9
    assert sorted(set(map(int, re.findall(r"user.py:(\d+): error:", result.stdout)))) == wrong, result.stdout


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
