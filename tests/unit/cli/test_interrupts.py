import signal
import subprocess
import sys
import threading

import pytest

from scanlock.cli import main
from scanlock.cli.interrupts import interrupt_delayed, interrupts_raised
from scanlock.interrupts import children_ignore_interrupts

if sys.platform == "win32":
    pytest.skip("needs the signals of POSIX systems", allow_module_level=True)


def _send(number):
    # Sent to the process, so that the handler raises.
    signal.raise_signal(number)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_signals_end_a_command_without_output(scanlock, monkeypatch, scans, number, code):
    before = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    monkeypatch.setattr("scanlock.io.describe_scan", lambda *_, **__: _send(number))
    done = scanlock("info", scans / "target.npy")
    assert (done.code, done.out, done.err) == (code, "", "")
    after = [signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    assert after == before


@pytest.mark.parametrize("depth", [1, 2])
def test_a_system_error_caused_by_an_interrupt_is_an_interrupt(scanlock, monkeypatch, scans, depth):
    def return_and_raise(*_, **__):
        try:
            _send(signal.SIGTERM)
        except KeyboardInterrupt as interrupt:
            error = interrupt
        for _ in range(depth):
            broken = SystemError("returned a result with an exception set")
            broken.__cause__ = error
            error = broken
        raise error

    monkeypatch.setattr("scanlock.io.describe_scan", return_and_raise)
    done = scanlock("info", scans / "target.npy")
    assert (done.code, done.out, done.err) == (143, "", "")


def test_other_system_errors_are_raised_unchanged():
    with pytest.raises(SystemError, match="fault"), interrupts_raised():
        raise SystemError("fault") from ValueError("bad")


def test_an_ignored_hangup_signal_remains_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interrupts_raised():
            _send(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_interrupt_is_delayed_until_the_end_of_the_block():
    done = []

    def work():
        with interrupt_delayed():
            _send(signal.SIGINT)
            done.append("first")
            done.append("second")
        done.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["first", "second"]


@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM])
def test_a_second_interrupt_is_raised_at_once(first):
    done = []

    def work():
        with interrupts_raised(), interrupt_delayed():
            _send(first)
            done.append("first")
            _send(signal.SIGINT)
            done.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["first"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_in_the_block_is_raised_before_the_interrupt():
    def fail():
        with interrupt_delayed():
            _send(signal.SIGINT)
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        fail()


def test_signals_with_the_default_action_are_not_delayed():
    # Outside of the command line, the signal ends the process immediately.
    with interrupt_delayed():
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_commands_run_in_other_threads():
    codes = []

    def run():
        with interrupt_delayed(), children_ignore_interrupts():
            codes.append(main(["--version"]))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert codes == [0]


def test_child_processes_ignore_the_interrupt_of_a_terminal():
    code = "import signal; print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)"
    with children_ignore_interrupts():
        child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    out, _ = child.communicate()
    assert out.split() == [b"True"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
