import hashlib
import os

import pytest

from tidemesh.errors import InputError
from tidemesh.io.files import atomic, sha256


def test_a_complete_file_takes_its_place(tmp_path):
    path = tmp_path / "mesh.14"
    path.write_text("old")
    with atomic(path) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".14"
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["mesh.14"]


@pytest.mark.parametrize("fault", [RuntimeError, KeyboardInterrupt])
def test_a_fault_leaves_the_old_file_and_nothing_else(tmp_path, fault):
    path = tmp_path / "mesh.14"
    path.write_text("old")

    def write_half():
        with atomic(path) as temporary:
            temporary.write_text("half")
            raise fault

    with pytest.raises(fault):
        write_half()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["mesh.14"]


def enter(path):
    with atomic(path):
        pass


def test_output_that_cannot_be_written_is_named_with_a_remedy(tmp_path):
    with pytest.raises(InputError, match=r"out.nc: the folder .*none does not exist"):
        enter(tmp_path / "none" / "out.nc")
    with pytest.raises(InputError, match="is a folder"):
        enter(tmp_path)


def test_folder_without_permission_is_named(tmp_path, monkeypatch):
    """Refused by the system itself, or in its place: a superuser may write anywhere."""
    if os.name == "nt" or os.geteuid() == 0:

        def refuse(*arguments, **options):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("tidemesh.io.files.open", refuse, raising=False)
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match=r"cannot be written \(Permission denied\)"):
        enter(tmp_path / "out.nc")


def test_other_errors_of_the_system_pass(tmp_path):
    with pytest.raises(FileNotFoundError), atomic(tmp_path / "a"):
        (tmp_path / "missing").read_text()
    assert os.listdir(tmp_path) == []


def test_sha256(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"abc" * 1_000_000)
    assert sha256(path) == hashlib.sha256(b"abc" * 1_000_000).hexdigest()
    with pytest.raises(InputError, match="missing: cannot be read"):
        sha256(tmp_path / "missing")
