"""Time left of long work."""

import io

from reference_sim.command_line import BELIEVED_SHARE, announce_compilation, progress_bar


def _time_left(*, done, seconds, **options):
    bar = progress_bar(total=3600.0, file=io.StringIO(), **options)
    bar.update(done)
    bar.start_t -= seconds
    shown = bar.format_dict
    bar.close()
    return (shown["total"] - shown["n"]) / shown["rate"]


def test_time_left_is_known_before_a_task_has_ended():
    assert abs(_time_left(done=0.0, seconds=0.0, expected_rate=2.0) - 1800.0) < 1.0
    early = _time_left(done=1.0, seconds=30.0, expected_rate=2.0)
    assert 1800.0 < early < 1.3 * 1800.0


def test_time_left_follows_what_is_measured_in_the_end():
    hour = 3600.0
    measured = (hour - 1800.0) / 0.5  # half of the work in an hour: twice as slow as expected of one worker
    left = _time_left(done=1800.0, seconds=hour, expected_rate=1.0)
    assert measured / (1.0 + 2.0 * BELIEVED_SHARE) < left < measured


def test_compilation_is_announced_where_no_compiled_kernel_lies_on_disk(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    announce_compilation()
    assert capsys.readouterr().err.startswith("first use: kernels are compiled")
    folder = tmp_path / "reference_sim.kernels.fast_kernels-0123456789abcdef"
    folder.mkdir()
    (folder / "sweep-1.py311.nbi").touch()
    announce_compilation()
    assert capsys.readouterr().err == ""
