# SPDX-License-Identifier: Apache-2.0
"""One thread on the newest job."""

import threading

from socialcircle_ros.node.worker import LatestWorker, QueueWorker


class Gate:
    """A worker with work that waits until it is let through."""

    def __init__(self):
        self.begun, self.through = threading.Semaphore(0), threading.Semaphore(0)
        self.done, self.dropped = [], []
        self.worker = LatestWorker(self.work, self.dropped.append)

    def work(self, job):
        self.begun.release()
        self.through.acquire()
        self.done.append(job)


def test_the_newest_job_wins_and_the_overtaken_ones_are_dropped():
    gate = Gate()
    gate.worker.put('first')
    gate.begun.acquire()
    for job in ('second', 'third', 'fourth'):
        gate.worker.put(job)
    gate.through.release(2)
    gate.worker.drain()
    gate.worker.stop()
    assert gate.done == ['first', 'fourth']
    assert gate.dropped == ['second', 'third']


def test_stopping_lets_the_job_at_hand_end_and_starts_no_other():
    gate = Gate()
    gate.worker.put('first')
    gate.begun.acquire()
    gate.worker.put('second')
    stopping = threading.Thread(target=gate.worker.stop)
    stopping.start()
    gate.through.release(2)
    stopping.join()
    assert gate.done[0] == 'first'
    assert sorted(gate.done[1:] + gate.dropped) == ['second']
    gate.worker.stop()


def test_what_is_forgotten_counts_as_dropped():
    gate = Gate()
    gate.worker.put('first')
    gate.begun.acquire()
    gate.worker.put('second')
    gate.worker.forget()
    assert gate.dropped == ['second']
    gate.through.release()
    gate.worker.stop()
    assert gate.done == ['first']
    assert gate.dropped == ['second']


def test_an_item_that_waits_for_no_other_is_worked_on_when_the_worker_is_to_forget_or_stop():
    done, dropped = [], []
    worker = LatestWorker(done.append, dropped.append)
    with worker._changed:  # the thread cannot begin yet
        worker.put('forget')
        worker.forget()
    worker.drain()
    with worker._changed:
        worker.put('stop')
        assert not worker.stop(lambda: False)
    assert worker.stop()
    assert (done, dropped) == (['forget', 'stop'], [])


def test_an_idle_worker_ends_where_no_patience_is_left():
    assert LatestWorker(print, print).stop(lambda: False)
    assert QueueWorker(print, lambda: None, pause_s=10.0).stop(lambda: False)


def test_work_at_hand_is_waited_for_only_as_long_as_there_is_patience():
    gate = Gate()
    assert gate.worker.busy_s <= 0
    gate.worker.put('first')
    gate.begun.acquire()
    assert gate.worker.busy_s > 0
    assert not gate.worker.stop(lambda: False)
    gate.through.release()
    assert gate.worker.stop()
    assert gate.worker.busy_s <= 0


def test_draining_an_idle_worker_returns_at_once():
    gate = Gate()
    gate.worker.drain()
    gate.worker.stop()
    assert gate.done == []


def test_what_waits_in_a_queue_is_given_back_when_it_is_forgotten():
    begun, through, done = threading.Event(), threading.Event(), []

    def work(job):
        begun.set()
        through.wait()
        done.append(job)

    worker = QueueWorker(work, lambda: None, pause_s=10.0)
    for job in (1, 2, 3):
        worker.put(job)
    begun.wait()
    stopping = threading.Thread(target=worker.stop)
    stopping.start()
    assert worker.forget() == [2, 3]
    through.set()
    stopping.join()
    assert done == [1]
    assert worker.forget() == []


def test_a_queue_that_is_full_takes_nothing_more():
    begun, through, done = threading.Semaphore(0), threading.Semaphore(0), []

    def work(item):
        begun.release()
        through.acquire()
        done.append(item)

    worker = QueueWorker(work, lambda: None, 0.01)
    assert worker.put_if_room(0, 3)
    begun.acquire()
    assert [worker.put_if_room(number, 3) for number in range(1, 6)] == [True, True, True, False, False]
    through.release(4)
    for _ in range(3):
        begun.acquire()
    worker.stop()
    assert done == [0, 1, 2, 3]
