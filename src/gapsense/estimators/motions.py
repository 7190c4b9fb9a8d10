"""The queue of motions of a smoother: where their samples are kept, and which one is next.

A motion begins where the contact signal says that the mover has left its stop. It ends where the signal says that it is
on one. If the mover comes back to the stop that it left, that was no motion in two cases. It was a bounce if contact
had been made within the time of debouncing, however long it took. It was a glitch if the mover was away for no longer
than that time.

Motions wait in the order of their landings, first to be smoothed, then to be published, at one sample per step each. At
its landing the last sample of a motion is smoothed at once, before those that wait.

No sample waits for more than `Room.ring` steps, however the motions follow each other. Each motion takes at least as
many steps as it needs, landings in between take one step of two, and publishing waits for at most `Room.length` more.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.reduced_model import is_moving, limit
from gapsense.kernels.layout import COUNT, Array, Count, Memory, Scalar, Whole, zeros
from gapsense.kernels.trace import cond, floor, load, not_, store, where

LENGTH = 1024  # samples of a motion that are kept, at most
RING = 3 * LENGTH  # samples of all motions, each with the sample of its landing
QUEUE = RING // 2  # motions that may wait: each takes a sample at least, and one at rest
ENTRY = 3  # numbers of a motion that waits: place of its first sample kept, samples kept, time of the sample before


class Room(NamedTuple):
    """What of the memory is used."""

    length: Scalar  # samples of a motion that are kept, the last ones
    ring: Scalar
    queue: Scalar


def room_for(length: Scalar) -> Room:
    """Room for motions of so many samples."""
    ring = 3.0 * floor(length)
    return Room(length=floor(length), ring=ring, queue=floor(0.5 * ring))


class Contact(NamedTuple):
    """What the contact signal says, at a sample and at that before it."""

    time: Scalar  # of the sample [s]
    mode: Scalar
    mode_prev: Scalar
    sample_time: Scalar  # [s]
    debounce: Scalar  # [s]
    room: Room


class Motion(NamedTuple):
    """The motion being recorded, or the last one."""

    place: Annotated[
        Scalar, Whole(0, RING - 1)
    ]  # of its first sample; those after it count on, also beyond the end of the memory
    count: Annotated[Scalar, Count]  # its samples so far; 0: the mover was not seen to take off
    start: Scalar  # time of the last sample before it [s]
    stop: Scalar  # that it left: 0 the lower, 1 the upper
    contact: Scalar  # time of the last landing or bounce [s]


class Followed(NamedTuple):
    """The motion at a sample, and whether it ends there."""

    motion: Motion
    lands: Scalar
    bounces: Scalar  # it is back from a bounce: that was no motion


class Queue(NamedTuple):
    """Motions that have landed, numbered from 0 on."""

    landed: Annotated[Scalar, Count]  # how many have landed
    smoothed: Annotated[Scalar, Count]  # how many of these are smoothed
    samples_smoothed: Annotated[Scalar, Whole(0, LENGTH)]  # of the next one; its last sample was with its landing
    shown: Annotated[Scalar, Count]  # how many are published
    samples_shown: Annotated[Scalar, Whole(0, LENGTH)]  # of the next one
    waiting: Annotated[Array, Memory(QUEUE * ENTRY, (COUNT, (0, LENGTH), None), used="motion_memory")]


class Turn(NamedTuple):
    """The next sample, if there is one."""

    is_due: Scalar
    place: Scalar


def nothing(time: Scalar) -> tuple[Motion, Queue]:
    """No motion recorded, none waiting."""
    return Motion(place=0.0, count=0.0, start=time, stop=0.0, contact=time), Queue(
        landed=0.0, smoothed=0.0, samples_smoothed=1.0, shown=0.0, samples_shown=0.0, waiting=zeros(QUEUE * ENTRY)
    )


def slot(place: Scalar, room: Room) -> Scalar:
    """Index in the memory of samples."""
    return _within(place, room.ring)


def _within(number: Scalar, size: Scalar) -> Scalar:
    return number - size * floor(number / size)


def follow(motion: Motion, c: Contact) -> Followed:
    """The motion with this sample."""
    moves, moved = is_moving(c.mode), is_moving(c.mode_prev)
    takes_off, ends = moves & not_(moved), moved & not_(moves) & (motion.count > 0.0)
    is_back, longest = ends & (limit(c.mode) == motion.stop), c.debounce + 0.5 * c.sample_time  # times are rounded
    is_bounce = is_back & (motion.start - motion.contact <= longest) & (c.debounce > 0.0)
    is_glitch = is_back & not_(is_bounce) & (motion.count * c.sample_time <= longest)
    grown = where(moves & (motion.count > 0.0), motion.count + 1.0, motion.count)
    after = motion.place + where(motion.count > 0.0, motion.count + 1.0, 0.0)  # the sample of the landing is kept too
    found = Motion(
        place=where(takes_off, slot(after, c.room), motion.place),
        count=where(takes_off, 1.0, where(is_bounce | is_glitch, 0.0, grown)),
        start=where(takes_off, c.time - c.sample_time, motion.start),
        stop=where(takes_off, limit(c.mode_prev), motion.stop),
        contact=where(moved & not_(moves | is_glitch), c.time, motion.contact),
    )
    return Followed(found, ends & not_(is_bounce | is_glitch), is_bounce)


def to_keep(now: Followed, c: Contact) -> Turn:
    """Where this sample is kept, if it belongs to a motion."""
    motion, lands, _ = now
    moves = is_moving(c.mode) & (motion.count > 0.0)
    return Turn(moves | lands, motion.place + motion.count - where(lands, 0.0, 1.0))


def join(queue: Queue, now: Followed, c: Contact) -> Queue:
    """Add a motion that lands to the queue, with as many of its last samples as there is room for."""
    motion, lands, _ = now

    def landed() -> Queue:
        kept = where(motion.count > c.room.length, c.room.length, motion.count)
        lost = motion.count - kept
        row, waiting = _within(queue.landed, c.room.queue) * ENTRY, queue.waiting
        for k, value in enumerate((motion.place + lost, kept, motion.start + lost * c.sample_time)):
            waiting = store(waiting, row, value, k)
        return queue._replace(landed=queue.landed + 1.0, waiting=waiting)

    return cond(lands, landed, lambda: queue)


def to_smooth(queue: Queue, now: Followed, room: Room) -> tuple[Queue, Turn]:
    """The last sample of a motion that lands, else that with which the motion in turn goes on."""
    motion, lands, _ = now
    place, kept, _ = _entry(queue, queue.smoothed, room)
    done = queue.samples_smoothed
    goes_on = (queue.smoothed < queue.landed) & (done < kept) & not_(lands)
    turn = Turn(lands | goes_on, where(lands, motion.place + motion.count - 1.0, place + kept - done - 1.0))
    done = where(goes_on, done + 1.0, done)
    is_smoothed = (queue.smoothed < queue.landed) & (done >= kept)
    smoothed = where(is_smoothed, queue.smoothed + 1.0, queue.smoothed)
    return queue._replace(smoothed=smoothed, samples_smoothed=where(is_smoothed, 1.0, done)), turn


def to_show(queue: Queue, c: Contact) -> tuple[Queue, Turn, Scalar]:
    """The next sample of the motions that are smoothed, and its time."""
    place, kept, start = _entry(queue, queue.shown, c.room)
    is_due = queue.shown < queue.smoothed
    done = queue.samples_shown + 1.0
    turn = Turn(is_due, place + queue.samples_shown)
    is_shown = is_due & (done >= kept)
    samples_shown = where(is_shown, 0.0, where(is_due, done, queue.samples_shown))
    shown = where(is_shown, queue.shown + 1.0, queue.shown)
    return queue._replace(shown=shown, samples_shown=samples_shown), turn, start + done * c.sample_time


def _entry(queue: Queue, number: Scalar, room: Room) -> tuple[Scalar, ...]:
    row = _within(number, room.queue) * ENTRY
    return tuple(load(queue.waiting, row, k) for k in range(ENTRY))
