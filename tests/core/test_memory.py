# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory within the limits of control groups, on made files of the kernel: as its documentation gives them."""

from pathlib import Path

import pytest
from rockfall.core.errors import InputError
from rockfall.core.memory import available_bytes, check_memory

GIB = 1 << 30
V1_NO_LIMIT = 9223372036854771712
V2 = "31 23 0:28 / /sys/fs/cgroup rw,nosuid shared:9 - cgroup2 cgroup2 rw,nsdelegate\n"
V1 = (
    "31 23 0:28 / /sys/fs/cgroup rw - tmpfs tmpfs rw,mode=755\n"
    "32 31 0:29 / /sys/fs/cgroup/cpu rw - cgroup cgroup rw,cpu,cpuacct\n"
    "35 31 0:32 {} /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n"
)


def machine(root: Path, groups: str, mounts: str, files: dict[str, str | int], available: int = 64 * GIB) -> Path:
    """A folder with what Linux says in /proc and in the mounted control groups."""
    files = {
        "proc/meminfo": f"MemTotal: {100 * GIB // 1024} kB\nMemFree: 9 kB\nMemAvailable: {available // 1024} kB\n",
        "proc/self/cgroup": groups,
        "proc/self/mountinfo": "23 1 8:1 / / rw - ext4 /dev/sda1 rw\n" + mounts,
        **{f"sys/fs/cgroup/{name}": text for name, text in files.items()},
    }
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n", encoding="utf-8")
    return root


def test_without_control_groups_the_machine_counts(tmp_path: Path) -> None:
    assert available_bytes(machine(tmp_path, "", "", {})) == 64 * GIB
    (tmp_path / "proc/self/cgroup").unlink()
    assert available_bytes(tmp_path) == 64 * GIB


def test_a_group_of_version_2(tmp_path: Path) -> None:
    """What it uses is taken away, without the caches of files that the kernel gives up."""
    files = {
        "a.slice/memory.max": 8 * GIB,
        "a.slice/memory.current": 3 * GIB,
        "a.slice/memory.stat": f"anon {2 * GIB}\nfile {GIB}\nactive_file 0\ninactive_file {GIB}",
    }
    root = machine(tmp_path, "0::/a.slice", V2, files)
    assert available_bytes(root) == 6 * GIB
    (root / "sys/fs/cgroup/a.slice/memory.high").write_text(f"{5 * GIB}\n")  # above it, processes are slowed down
    assert available_bytes(root) == 3 * GIB
    (root / "sys/fs/cgroup/a.slice/memory.current").write_text(f"{7 * GIB}\n")
    assert available_bytes(root) == 0
    for name in ("max", "high"):
        (root / f"sys/fs/cgroup/a.slice/memory.{name}").write_text("max\n")
    assert available_bytes(root) == 64 * GIB


def test_the_machine_may_have_less_than_the_group(tmp_path: Path) -> None:
    files = {"memory.max": 32 * GIB, "memory.current": 0}
    assert available_bytes(machine(tmp_path, "0::/", V2, files, available=2 * GIB)) == 2 * GIB


@pytest.mark.parametrize("tightest", ["", "machine.slice/", "machine.slice/job_7/", "machine.slice/job_7/step_0/"])
def test_each_group_above_counts(tmp_path: Path, tightest: str) -> None:
    files: dict[str, str | int] = {}
    for name in ("machine.slice/", "machine.slice/job_7/", "machine.slice/job_7/step_0/", ""):
        files[f"{name}memory.max"] = 4 * GIB if name == tightest else 20 * GIB if name else "max"
        files[f"{name}memory.current"] = GIB
    assert available_bytes(machine(tmp_path, "0::/machine.slice/job_7/step_0", V2, files)) == 3 * GIB


def test_a_group_of_version_1(tmp_path: Path) -> None:
    files = {
        "memory/docker/ab/memory.limit_in_bytes": 2 * GIB,
        "memory/docker/ab/memory.usage_in_bytes": GIB,
        "memory/docker/ab/memory.stat": f"inactive_file 5\ntotal_inactive_file {GIB // 2}",
        "memory/docker/memory.limit_in_bytes": V1_NO_LIMIT,
        "memory/docker/memory.usage_in_bytes": 40 * GIB,
        "cpu/docker/ab/memory.limit_in_bytes": 1,  # of another controller
    }
    groups = "9:name=systemd:/x\n4:memory:/docker/ab\n1:cpu,cpuacct:/docker/ab\n0::/"
    assert available_bytes(machine(tmp_path, groups, V1.format("/"), files)) == GIB + GIB // 2


@pytest.mark.parametrize("inside", ["/docker/ab", "/elsewhere"])
def test_inside_a_container_its_group_is_mounted_as_the_root(tmp_path: Path, inside: str) -> None:
    files = {"memory/memory.limit_in_bytes": 2 * GIB, "memory/memory.usage_in_bytes": GIB}
    root = machine(tmp_path, "4:memory:/docker/ab", V1.format(inside), files)
    assert available_bytes(root) == GIB


def test_a_process_outside_of_the_mounted_root_and_a_place_with_a_space(tmp_path: Path) -> None:
    mounts = r"31 23 0:28 / /sys/fs/cgroup/my\040groups rw - cgroup2 cgroup2 rw" + "\n"
    files = {"my groups/memory.max": GIB, "my groups/memory.current": 0, "memory.max": 1}
    assert available_bytes(machine(tmp_path, "0::/../other", mounts, files)) == GIB


def test_files_that_cannot_be_understood_limit_nothing(tmp_path: Path) -> None:
    files = {"memory.max": "many", "memory.current": "few", "memory.stat": "inactive_file"}
    assert available_bytes(machine(tmp_path, "0::/", V2, files)) == 64 * GIB
    (tmp_path / "sys/fs/cgroup/memory.max").write_text(f"{GIB}\n")
    assert available_bytes(tmp_path) == GIB


def test_who_asks_for_memory_is_told_the_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    root = machine(tmp_path, "0::/", V2, {"memory.max": GIB, "memory.current": 0})
    monkeypatch.setattr("rockfall.core.memory.available_bytes", lambda: available_bytes(root))
    check_memory("the picture", GIB, "a.tif")
    with pytest.raises(InputError, match=r"the picture needs 2\.1 GB of memory, and 1\.1 GB are there"):
        check_memory("the picture", 2 * GIB, "a.tif")
