"""The Makefile, the lock files, the container: what they promise each other.

No container engine is needed: every set-up step of the Dockerfile is a target of the Makefile, and those are
what `make serve` and `make test` themselves run.
"""

import ast
import functools
import json
import os
import platform
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml

from app.settings import Settings
from deploy import licences

ROOT = Path(__file__).parents[1]
DOCKERFILE = (ROOT / "Dockerfile").read_text()
MAKEFILE = (ROOT / "Makefile").read_text()
COMPOSE, COMPOSE_OF_MANY = ROOT / "docker-compose.yml", ROOT / "deploy" / "compose.scale.yml"
LOCKS = sorted(ROOT.glob("requirements*.lock"))


installed_packages = functools.cache(packages_distributions)


def make_targets() -> set[str]:
    return set(re.findall(r"^([a-z-]+):(?!=)", MAKEFILE, re.MULTILINE))


def instructions() -> list[tuple[str, str]]:
    """(instruction, arguments) of the Dockerfile, continued lines joined."""
    joined = re.sub(r"\\\n\s*", " ", re.sub(r"^#.*\n", "", DOCKERFILE, flags=re.MULTILINE))
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in joined.splitlines() if line)]


def arguments_of(instruction: str) -> list[str]:
    return [rest.strip() for word, rest in instructions() if word == instruction]


def run_make(*arguments: str, **environment: str) -> str:
    """Output of `make` in an environment as bare as a fresh machine's."""
    bare = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": os.environ.get("HOME", "/"), **environment}
    done = subprocess.run(
        ["make", *arguments], cwd=ROOT, env=bare, capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout + done.stderr


def pins(lock: Path) -> dict[str, set[str]]:
    """Versions of every distribution that a lock file names (several where Python versions differ)."""
    found: dict[str, set[str]] = {}
    for name, version in re.findall(r"^([A-Za-z0-9._-]+)==([^\s;]+)", lock.read_text(), re.MULTILINE):
        found.setdefault(name, set()).add(version)
    return found


def test_every_step_of_the_container_is_the_makefiles() -> None:
    bring_compiler, compiles, bring_make, *steps = arguments_of("RUN")
    for bring, packages in ((bring_compiler, "make gcc libc6-dev"), (bring_make, "make")):
        install = f"apt-get install --yes --no-install-recommends {packages}"
        assert bring == f"apt-get update && {install} && rm -rf /var/lib/apt/lists/*"
    assert compiles == "make kernels"
    assert steps
    assert {step.partition(" ")[0] for step in steps} == {"make"}
    words = {word for step in steps for word in step.split()[1:]}
    assert {word for word in words if "=" not in word} <= make_targets()
    settings = {"LANGUAGES", "HEIC", "SECOND_READER", "KERNELS"}
    assert {word.partition("=")[0] for word in words if "=" in word} <= settings


def test_the_container_copies_what_there_is_and_what_it_needs() -> None:
    lines = arguments_of("COPY")
    # The stage that compiles hands on what it has copied.
    assert "--from=kernels /app/services ./services" in lines
    words = (word for line in lines if not line.startswith("--from") for word in line.split())
    copied = {word for word in words if not word.startswith("./")}
    allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert copied == allowed
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert {"app", "services", "models", "Makefile", "requirements.lock"} <= copied


def test_the_container_runs_python_itself_as_nobody_special() -> None:
    (command,) = arguments_of("CMD")
    assert json.loads(command) == [".venv/bin/python", "-m", "app"]
    (user,) = arguments_of("USER")
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert f"DATA_OWNER ?= {user}" in MAKEFILE
    (environment,) = arguments_of("ENV")
    assert {"HOST=0.0.0.0", "PORT=8000", "DATA_DIR=/data"} <= set(environment.split())


def test_the_container_asks_after_its_own_health() -> None:
    (check,) = arguments_of("HEALTHCHECK")
    python, flag, code = json.loads(check[check.index("[") :])
    assert (python, flag) == (".venv/bin/python", "-c")
    ast.parse(code)
    assert "/health/live" in code


def test_compose() -> None:
    compose = yaml.safe_load(COMPOSE.read_text())
    (service,) = compose["services"].values()
    assert service["build"] == "."
    assert service["read_only"] is True
    assert any(mount.startswith("/tmp") for mount in service["tmpfs"])
    ((source, target),) = (volume.split(":") for volume in service["volumes"])
    assert source in compose["volumes"]
    assert target == service["environment"]["DATA_DIR"] == "/data"
    assert service["mem_limit"]
    assert int(service["stop_grace_period"].removesuffix("s")) > 30


def test_compose_of_many_machines() -> None:
    compose = yaml.safe_load(COMPOSE_OF_MANY.read_text())
    scaled = compose["services"]
    assert {"api", "worker", "postgres", "blobs"} <= set(scaled)
    assert {
        (COMPOSE_OF_MANY.parent / one["build"]).resolve() for one in scaled.values() if "build" in one
    } == {ROOT}
    api, worker = (scaled[name]["environment"] for name in ("api", "worker"))
    assert api["WORKERS"] == "0" != worker["WORKERS"]
    for name in ("DATABASE_URL", "BLOB_URL"):
        assert api[name] == worker[name]
    assert scaled["worker"]["command"] == [".venv/bin/python", "-m", "app", "worker"]
    for one in scaled.values():
        named = (volume.split(":")[0] for volume in one.get("volumes", ()))
        assert set(named) <= set(compose["volumes"])
        assert set(one.get("depends_on", ())) <= set(scaled)
    endpoint, bucket = urlsplit(api["AWS_ENDPOINT_URL"]), urlsplit(api["BLOB_URL"]).netloc
    assert f"-s3.port={endpoint.port}" in scaled[endpoint.hostname]["command"]
    assert f"-name {bucket}" in scaled["bucket"]["command"][0]


@pytest.mark.parametrize("name", ["document-rectification", "api", "worker"])
def test_compose_passes_every_setting(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    file = COMPOSE if name == "document-rectification" else COMPOSE_OF_MANY
    environment = yaml.safe_load(file.read_text())["services"][name]["environment"]
    of_others = {"TMPDIR", *(variable for variable in environment if variable.startswith("AWS_"))}
    assert {variable.lower() for variable in set(environment) - of_others} == set(Settings.model_fields)
    for variable, value in environment.items():
        if value is None:  # passed on where the shell has it
            monkeypatch.delenv(variable, raising=False)
        else:
            monkeypatch.setenv(variable, re.sub(r"\$\{\w+:[-?]([^}]*)\}", r"\1", value))
    settings = Settings()
    assert (settings.host, settings.port) == ("0.0.0.0", 8000)
    assert bool(settings.database_url) == bool(settings.blob_url) == (name != "document-rectification")


def test_compose_has_no_default_passwords() -> None:
    for file in (COMPOSE, COMPOSE_OF_MANY):
        for name, value in re.findall(
            r"^ +(\w*(?:PASSWORD|SECRET)\w*):(.*)$", file.read_text(), re.MULTILINE
        ):
            assert not value or re.fullmatch(r" \$\{\w+:\?[^}]+\}", value), name
        assert not re.search(r":[^$/@\s]+@", file.read_text())


def test_serve_listens_where_it_is_told() -> None:
    assert "-m app" in run_make("--dry-run", "serve")
    assert "127.0.0.1:8000" in run_make("help")
    assert "0.0.0.0:9001" in run_make("help", HOST="0.0.0.0", PORT="9001")


def test_help_names_every_target_that_a_person_calls() -> None:
    told = set(re.findall(r"^make (\S+)", run_make("help"), re.MULTILINE))
    assert told <= make_targets()
    steps = {
        "python",
        "venv-dev",
        "venv-bench",
        "postgresql",
        "chromium",
        "java",
        "typescript",
        "data-folder",
    }
    assert make_targets() - told <= {"help"} | steps


def test_an_environment_is_made_anew_for_another_lock_python_or_place(tmp_path: Path) -> None:
    def stamps(folder: Path, python: str) -> set[str]:
        variables = subprocess.run(
            ["make", "-C", str(folder), "--print-data-base", "--dry-run", "help", f"PYTHON={python}"],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        ).stdout
        return set(re.findall(r"^(?:CREATED|RUNTIME) := (.*)$", variables, re.MULTILINE))

    places = [tmp_path / name for name in ("one", "two")]
    for place in places:
        place.mkdir()
        (place / "Makefile").write_text(MAKEFILE)
        (place / "requirements.lock").write_text("numpy==2.4.6\n")
    one = stamps(places[0], sys.executable)
    assert len(one) == 2
    assert stamps(places[0], sys.executable) == one
    assert not one & stamps(places[1], sys.executable)
    assert not one & stamps(places[0], "/another/python")
    (places[0] / "requirements.lock").write_text("numpy==2.4.7\n")
    assert len(one & stamps(places[0], sys.executable)) == 1  # the empty environment is the same


def test_the_data_folder_is_made(tmp_path: Path) -> None:
    run_make("data-folder", DATA_DIR=str(tmp_path / "data"), DATA_OWNER=f"{os.getuid()}:{os.getgid()}")
    assert (tmp_path / "data").is_dir()


def test_the_checks_of_a_change() -> None:
    script = ROOT / ".ci" / "run"
    assert os.access(script, os.X_OK)
    assert re.findall(r"^make (\w+)$", script.read_text(), re.MULTILINE) == ["lint", "test"]


def test_before_a_commit_runs_what_lint_runs() -> None:
    (source,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert [hook["entry"] for hook in source["hooks"]] == ["make lint"]


def test_what_is_built_is_what_the_container_runs() -> None:
    built = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    packages = {name.removesuffix("*") for name in built["packages"]["find"]["include"]}
    words = {word for line in arguments_of("COPY") for word in line.split() if not word.startswith("./")}
    assert packages == {word for word in words if (ROOT / word / "__init__.py").exists()}
    kept = {"*.py", *(name.rpartition("/")[2] for names in built["package-data"].values() for name in names)}
    files = [path for name in packages for path in (ROOT / name).rglob("*") if path.is_file()]
    # What was compiled here is made anew on the machine that runs it.
    files = [path for path in files if path.suffix not in {".pyc", ".library"}]
    assert [path for path in files if not any(map(path.match, kept))] == []
    assert built["dynamic"]["version"] == {"attr": "app.__version__"}


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_locks_pin_everything_and_name_no_place(lock: Path) -> None:
    text = re.sub(r" \\\n +", " ", lock.read_text())  # hashes follow on lines of their own
    lines = [line for line in text.splitlines() if line and not line.lstrip().startswith("#")]
    assert lines
    pin = r"[a-z0-9._-]+==[^\s;]+( ; .+?)?( --hash=sha256:[0-9a-f]{64})+"
    assert [line for line in lines if not re.fullmatch(pin, line)] == []
    assert not re.search(r"://|index-url|find-links|@ |/opt|/tmp|/work", text)


def test_every_package_is_installed_by_its_hash() -> None:
    assert "--require-hashes" in MAKEFILE
    installs = re.findall(r"pip install|\$\(PIP_INSTALL\) .*", MAKEFILE)
    assert [line for line in installs if "requirements" not in line] == ["pip install"]  # PIP_INSTALL itself


def test_what_the_image_holds_is_told_as_it_is() -> None:
    parts = licences.find_parts()
    here = {(part.name, part.version) for part in parts if part.wheel is None}
    page, bill = licences.PAGE.read_text(), json.loads(licences.BILL.read_text())
    told = {
        (name, version)
        for name, version, _ in re.findall(r"^\| (\S+) \| (\S+) \| ([^|]+) \|$", page, re.MULTILINE)
    }
    listed = {(one["name"], one["version"]) for one in bill["components"] if "group" not in one}
    assert here <= told
    assert listed <= told
    # Wheels of other machines and Pythons hold other libraries.
    if (sys.version_info[:2], platform.machine()) == ((3, 11), "x86_64"):
        assert listed == here
        assert licences.page_of(parts) == page
        assert licences.bill_of(parts) == licences.BILL.read_text()


def test_a_part_without_a_known_licence_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(licences._OF_LIBRARY, "libheif")
    with pytest.raises(licences.UnknownLicence, match="libheif"):
        licences.find_parts()


def test_what_is_tested_is_what_is_served() -> None:
    service, development = pins(ROOT / "requirements.lock"), pins(ROOT / "requirements-dev.lock")
    assert {name: development.get(name) for name in service} == service


def imported_by(folders: list[str]) -> Iterator[str]:
    """Top-level names of all modules that the sources in `folders` import."""
    for path in (path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        # Without parsing, which takes 5 s for all files. A sentence of a docstring may pass for an import.
        yield from re.findall(
            r"^\s*(?:import|from) (\w+)[\w.]*(?: import\b| as\b|,|$)", path.read_text(), re.MULTILINE
        )


@pytest.mark.parametrize(
    ("folders", "lock"),
    [
        (["app", "services", "models"], "requirements.lock"),
        (["tests", "simulation"], "requirements-dev.lock"),
    ],
)
def test_what_is_imported_is_locked(folders: list[str], lock: str) -> None:
    ours = {path.name for folder in (ROOT, ROOT / "clients" / "python") for path in folder.iterdir()}
    foreign = set(imported_by(folders)) - set(sys.stdlib_module_names) - ours
    distributions = installed_packages()
    locked = {re.sub(r"[-_.]+", "-", name).lower() for name in pins(ROOT / lock)}
    missing = {
        name
        for name in foreign
        if not {re.sub(r"[-_.]+", "-", dist).lower() for dist in distributions.get(name, [])} & locked
    }
    assert missing == set()


def test_one_process_runs_all_tests_of_a_module(request: pytest.FixtureRequest) -> None:
    """Fixtures of a module are made once; pytest-xdist writes the group into the names of tests."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        assert request.node.nodeid.endswith("@test_delivery.py")
    assert [mark.args for mark in request.node.iter_markers("xdist_group")] == [("test_delivery.py",)]
