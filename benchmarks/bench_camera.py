"""Camera room: how fast pictures are made and read, how often the board is found, how well its pose is measured.

    python benchmarks/bench_camera.py speed | grid | approaches | gate | fit

`speed`  thread-CPU milliseconds of renderer and detector by distance
`grid`   static pictures over distance x incidence: share found, errors against truth, predicted sigmas
`approaches`  moving approaches from behind (15 deg camera, 60 Hz), with the belief of the last pose as prior
`gate`   agreement of the model camera's visibility gate with the detector on random poses
`fit`    parameters of the measured noise set from random poses
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

import cv2
import numpy as np

from groundcar.board.layout import Board, rotation_from_car
from kernel.rotations import from_matrix, to_matrix
from vehicle.apriltag.detector import BoardDetector, BoardPose
from vehicle.camera.pinhole import Camera, board_visibility, camera_frame
from vehicle.render.pose import motion_row
from vehicle.render.renderer import Renderer

EXPOSURE_NS = 2_000_000
CAMERA, BOARD = Camera(), Board()
ROW = CAMERA.row()


@dataclass
class Shot:
    """One picture's truth: motion rows and the board in the optical frame."""

    vehicle: np.ndarray
    board: np.ndarray
    R: np.ndarray
    p: np.ndarray
    up: np.ndarray


def shot(vehicle: np.ndarray, board: np.ndarray) -> Shot:
    R, p = camera_frame(vehicle[:3], vehicle[6:10], ROW)
    return Shot(vehicle, board, R.T @ to_matrix(board[6:10]), R.T @ (board[:3] - p), R[2].copy())


def look_at(distance: float, incidence: float, rng: np.random.Generator, spread: float = 0.0) -> Shot:
    """A board `distance` m away, `incidence` rad from facing the camera; `spread` 0..1 moves it off the optical axis.

    The board keeps its y axis horizontal as on a car: incidence comes from inclination and from heading.
    """
    board_p = np.array([rng.uniform(-3, 3), rng.uniform(-3, 3), 1.5])
    for _ in range(10_000):
        heading, inclination = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, math.radians(80.0))
        R = rotation_from_car(heading, inclination)
        around = rng.uniform(0.0, 2.0 * math.pi)
        n, x, y = R[:, 2], R[:, 0], R[:, 1]
        line = math.cos(incidence) * n + math.sin(incidence) * (math.cos(around) * x + math.sin(around) * y)
        camera_p = board_p + distance * line
        if camera_p[2] < 0.3 or not -1.35 < math.asin(np.clip(-line[2], -1, 1)) < 0.5:
            continue
        # Aim: yaw and pitch so that the board stands at a chosen point of the picture
        du, dv = spread * rng.uniform(-0.8, 0.8), spread * rng.uniform(-0.45, 0.45)
        yaw = math.atan2(-line[1], -line[0]) + du
        depression = math.asin(np.clip(line[2], -1, 1))
        pitch = depression - CAMERA.tilt + dv
        roll = rng.uniform(-0.3, 0.3)
        cy, sy, cp, sp, cr, sr = (f(a) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
        Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1.0]])
        Ry = np.array([[cp, 0, sp], [0, 1.0, 0], [-sp, 0, cp]])
        Rx = np.array([[1.0, 0, 0], [0, cr, -sr], [0, sr, cr]])
        q = from_matrix(Rz @ Ry @ Rx)
        offset = camera_frame(np.zeros(3), np.array(q), ROW)[1]
        return shot(motion_row(camera_p - offset, q), motion_row(board_p, from_matrix(R)))
    raise RuntimeError("no such view")


def errors(result: BoardPose, truth: Shot) -> tuple[float, float, float, float]:
    """(lateral m, depth m, rotation rad, normal rad) errors of a pose that was found; lateral is the rms of x and y."""
    d = result.p - truth.p
    turn = result.R.T @ truth.R
    angle = math.acos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0))
    normal = math.acos(np.clip(result.R[:, 2] @ truth.R[:, 2], -1.0, 1.0))
    return math.sqrt(0.5 * (d[0] ** 2 + d[1] ** 2)), abs(float(d[2])), angle, normal


def disturbed(truth: Shot, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A belief to search with: 3 cm and 3 deg off."""
    turn = cv2.Rodrigues(rng.normal(0.0, math.radians(3.0), 3))[0]
    return truth.R @ turn, truth.p + rng.normal(0.0, 0.03, 3)


def rms(values: list[float]) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values else math.nan


def speed() -> None:
    rng, renderer = np.random.default_rng(1), Renderer(CAMERA, BOARD, 1)
    detector = BoardDetector(CAMERA, BOARD)
    print("distance  render p50 p90   detect on prior p50 p90   lost p50 p90   (thread-CPU ms)   decimate  found")
    for distance in (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0):
        made, read, lost, found, steps = [], [], [], 0, set()
        for k in range(24):
            truth = look_at(distance, math.radians(30), rng, 0.2)
            start = time.thread_time()
            image = renderer.render(truth.vehicle, truth.board, EXPOSURE_NS, k)
            made.append((time.thread_time() - start) * 1e3)
            prior = disturbed(truth, rng) if distance > 0.4 else (truth.R, truth.p)
            detector.search.misses = 0
            start = time.thread_time()
            result = detector.detect(image, prior, truth.up)
            read.append((time.thread_time() - start) * 1e3)
            found += result.found
            steps.add(round(result.work_px / 1000))
            start = time.thread_time()
            detector.detect(image, None, truth.up)
            lost.append((time.thread_time() - start) * 1e3)
        p = [np.percentile(t[4:], [50, 90]) for t in (made, read, lost)]
        print(f"{distance:5.1f} m   {p[0][0]:6.2f} {p[0][1]:6.2f}    {p[1][0]:10.2f} {p[1][1]:6.2f}"
              f"  {p[2][0]:12.2f} {p[2][1]:6.2f}    kpx {min(steps)}-{max(steps)}  {found}/24")  # fmt: skip


def grid(count: int = 6) -> None:
    rng, renderer = np.random.default_rng(2), Renderer(CAMERA, BOARD, 2)
    print("dist  inc   found prior/lost  lateral mm  depth mm  normal deg (p95)  rot deg | predicted lat depth rot")
    for distance in (0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0):
        for incidence in (0, 20, 40, 60, 70, 78):
            detector, rows, sigmas, lost = BoardDetector(CAMERA, BOARD), [], [], 0
            for k in range(count):
                truth = look_at(distance, math.radians(incidence), rng, 0.3 if distance > 0.6 else 0.05)
                image = renderer.render(truth.vehicle, truth.board, EXPOSURE_NS, k)
                detector.search.misses = 0
                result = detector.detect(
                    image, disturbed(truth, rng) if distance > 0.4 else (truth.R, truth.p), truth.up
                )
                if result.found:
                    rows.append(errors(result, truth))
                    sigmas.append((result.lateral_sigma, result.depth_sigma, result.orientation_sigma))
                detector.search.searches = 2
                lost += detector.detect(image, None, truth.up).found
            e = [rms([r[i] for r in rows]) for i in range(4)]
            s = np.mean(sigmas, axis=0) if sigmas else [math.nan] * 3
            p95 = np.percentile([r[3] for r in rows], 95) if rows else math.nan
            reasons = {k: v for k, v in detector.outcomes.items() if k != "found"}
            print(
                f"{distance:4.1f} {incidence:4d}   {len(rows)}/{count} {lost}/{count}    {e[0] * 1e3:8.2f}"
                f" {e[1] * 1e3:10.2f} {math.degrees(e[3]):8.2f} ({math.degrees(p95):5.2f}) {math.degrees(e[2]):8.2f} |"
                f" {s[0] * 1e3:6.2f} {s[1] * 1e3:6.2f} {math.degrees(s[2]):6.2f} | {reasons or ''}"
            )


def quintic(start: np.ndarray, end: np.ndarray, duration: float) -> np.ndarray:
    """Coefficients (6, 3) of the polynomials from `start` to `end`, both (3, 3): position, velocity, acceleration."""
    T = duration
    A = np.array([[T**3, T**4, T**5], [3 * T**2, 4 * T**3, 5 * T**4], [6 * T, 12 * T**2, 20 * T**3]])
    low = np.array([start[0], start[1], start[2] / 2])
    b = end - np.array([low[0] + low[1] * T + low[2] * T**2, low[1] + 2 * low[2] * T, 2 * low[2]])
    return np.concatenate((low, np.linalg.solve(A, b)))


def approach(inclination: float, speed: float, seed: int, dt: float = 1 / 60) -> list[Shot]:
    """Shots along a flight from about 3 m behind to contact: thrust along the acceleration, yaw towards the board."""
    rng = np.random.default_rng(seed)
    heading, duration, azimuth = rng.uniform(-3, 3), rng.uniform(1.6, 2.2), rng.uniform(-0.6, 0.6)
    forward = np.array([math.cos(heading), math.sin(heading), 0.0])
    behind = np.array([math.cos(heading + azimuth), math.sin(heading + azimuth), 0.0])
    R = rotation_from_car(heading, inclination)
    contact = np.array([0.0, 0.0, 1.5]) + speed * duration * forward
    start = np.stack(
        [
            np.array([0.0, 0, 1.5]) - rng.uniform(2.0, 3.3) * behind + [0, 0, rng.uniform(1.2, 2.0)],
            speed * forward,
            forward * 0,
        ]
    )
    n = R[:, 2]
    end = np.stack([contact + 0.05 * n, speed * forward - 0.6 * n, 8.0 * n - [0, 0, 9.80665]])
    c, powers, shots = quintic(start, end, duration), np.arange(6), []
    board_q, times = from_matrix(R), np.arange(0.0, duration, dt)
    for t in times:

        def attitude(at: float) -> np.ndarray:
            acceleration = sum(c[k] * k * (k - 1) * at ** (k - 2) for k in range(2, 6))
            z = acceleration + np.array([0.0, 0.0, 9.80665])
            z = z / np.linalg.norm(z)
            y = np.cross(z, forward)
            y /= np.linalg.norm(y)
            return np.column_stack((np.cross(y, z), y, z))

        q, Ra, Rb = from_matrix(attitude(t)), attitude(t - 1e-3), attitude(t + 1e-3)
        rate = cv2.Rodrigues(Ra.T @ Rb)[0].ravel() / 2e-3
        velocity = sum(c[k] * k * t ** (k - 1) for k in range(1, 6))
        vehicle = motion_row(c.T @ t**powers, q, velocity, rate)
        shots.append(shot(vehicle, motion_row(np.array([0, 0, 1.5]) + speed * t * forward, board_q, speed * forward)))
    return shots


def fly(shots: list[Shot], renderer: Renderer, detector: BoardDetector, dt: float = 1 / 60):
    """Results of an approach; the prior is the last pose in the world moved on by a velocity fitted on the way."""
    results, position, orientation, velocity, age = [], None, None, np.zeros(3), 0
    for k, truth in enumerate(shots):
        camera_R, camera_p = camera_frame(truth.vehicle[:3], truth.vehicle[6:10], ROW)
        prior = None
        if position is not None:
            position = position + velocity * dt
            prior = (camera_R.T @ orientation, camera_R.T @ (position - camera_p))
        result = detector.detect(renderer.render(truth.vehicle, truth.board, EXPOSURE_NS, k), prior, truth.up)
        age += 1
        if result.found:
            seen = camera_R @ result.p + camera_p
            if position is not None:
                velocity = velocity + 0.3 * (seen - position) / (age * dt)
            position, orientation, age = seen, camera_R @ result.R, 0
        results.append(result)
    return results


def approaches(flights: int = 6) -> None:
    print("incl speed  pictures  gate  found  found|gate  found|no gate  lateral mm  depth mm  normal deg rms p95 max"
          "  last pose s  error/sigma lat depth rot")  # fmt: skip
    everything = []
    for inclination in (20, 45, 70):
        for speed_ in (0.0, 2.0):
            rows, total, seen, gate, both, ghost, last, nees = [], 0, 0, 0, 0, 0, [], []
            for flight in range(flights):
                shots = approach(math.radians(inclination), speed_, flight)
                renderer, detector = Renderer(CAMERA, BOARD, flight), BoardDetector(CAMERA, BOARD)
                results, final = fly(shots, renderer, detector), 0
                for k, (truth, result) in enumerate(zip(shots, results, strict=True)):
                    v, b = truth.vehicle, truth.board
                    visible = board_visibility(v[:3], v[6:10], b[:3], to_matrix(b[6:10]), ROW)
                    total, seen, gate = total + 1, seen + result.found, gate + visible
                    both, ghost = both + (visible and result.found), ghost + (result.found and not visible)
                    if result.found:
                        e = errors(result, truth)
                        rows.append(e)
                        nees.append(
                            (e[0] / result.lateral_sigma, e[1] / result.depth_sigma, e[2] / result.orientation_sigma)
                        )
                        final = k
                last.append((len(shots) - 1 - final) / 60)
            everything += rows
            n = np.degrees([r[3] for r in rows])
            m = np.sqrt(np.mean(np.square(nees), axis=0))
            print(
                f"{inclination:3d}  {speed_:3.1f}    {total:6d}   {gate / total:5.2f}  {seen / total:5.2f}  "
                f" {both / max(gate, 1):6.3f}      {ghost / max(total - gate, 1):6.3f}    "
                f"{rms([r[0] for r in rows]) * 1e3:8.2f} {rms([r[1] for r in rows]) * 1e3:9.2f}"
                f"      {rms(list(n)):6.2f} {np.percentile(n, 95):5.2f} {n.max():5.2f}"
                f"     {np.mean(last):5.2f}    {m.round(2)}"
            )
    n = np.degrees([r[3] for r in everything])
    lateral, depth = (rms([r[i] for r in everything]) * 1e3 for i in (0, 1))
    print(f"all: {len(everything)} poses, rms lateral {lateral:.2f} mm, depth {depth:.2f} mm,"
          f" normal {rms(list(n)):.2f} deg (max {n.max():.2f})")  # fmt: skip


def random_views(count: int, seed: int, moving: bool, spread: float = 0.9):
    """Random views of the board with their results: (truth, result, prior used) for distances 0.15..9 m."""
    rng, renderer = np.random.default_rng(seed), Renderer(CAMERA, BOARD, seed)
    detector = BoardDetector(CAMERA, BOARD)
    for k in range(count):
        distance = math.exp(rng.uniform(math.log(0.15), math.log(9.0)))
        truth = look_at(distance, math.radians(rng.uniform(0.0, 82.0)), rng, spread)
        if moving:
            truth.vehicle[3:6] = rng.normal(0.0, 1.2, 3)
            truth.vehicle[10:13] = rng.normal(0.0, 0.9, 3)
        image = renderer.render(truth.vehicle, truth.board, EXPOSURE_NS, k)
        detector.search.misses = 0
        near = (truth.R, truth.p) if distance < 0.4 else disturbed(truth, rng)
        yield truth, detector.detect(image, near, truth.up)


def gate(count: int = 1500) -> None:
    table = np.zeros((2, 2), int)
    misses: list[str] = []
    for truth, result in random_views(count, 3, False, 1.0):
        v, b = truth.vehicle, truth.board
        visible = board_visibility(v[:3], v[6:10], b[:3], to_matrix(b[6:10]), ROW)
        table[visible, int(result.found)] += 1
        if visible != result.found:
            d = float(np.linalg.norm(truth.p))
            incidence = math.degrees(math.acos(np.clip(-truth.R[:, 2] @ truth.p / d, -1, 1)))
            u, w = CAMERA.fx * truth.p[0] / truth.p[2] + CAMERA.cx, CAMERA.fy * truth.p[1] / truth.p[2] + CAMERA.cy
            misses.append(f"gate {visible} found {int(result.found)} {result.reason or result.ids}: {d:.2f} m,"
                          f" {incidence:.0f} deg, centre at {u:.0f} {w:.0f}")  # fmt: skip
    print(f"gate shut: found {table[0, 1]} of {table[0].sum()}; gate open: found {table[1, 1]} of {table[1].sum()}")
    print("\n".join(misses[:60]))


def fit(count: int = 2500) -> None:
    """Maximum likelihood of sigma (1 d)^k2 (1 + k4 (1 - cos inc)) (1 + k5 v) for each channel, by random descent."""
    rows = []
    for truth, result in random_views(count, 5, True):
        if result.found:
            d = float(np.linalg.norm(truth.p))
            cos_incidence = float(np.clip(-truth.R[:, 2] @ truth.p / d, -1, 1))
            velocity = float(np.linalg.norm(truth.vehicle[3:6]))
            rows.append((d, truth.p[2] / d, cos_incidence, velocity, *errors(result, truth)))
    data, rng = np.array(rows), np.random.default_rng(0)
    print(f"{len(data)} poses")
    for name, column, floor in (("lateral", 4, 1e-6), ("depth", 5, 1e-6), ("rotation", 6, 1e-6)):
        squared = data[:, column] ** 2 + floor**2

        def model(x: np.ndarray) -> np.ndarray:
            axis, incidence = 1.0 + x[2] * (1.0 - data[:, 1]), 1.0 + x[3] * (1.0 - data[:, 2])
            return np.exp(x[0]) * data[:, 0] ** x[1] * axis * incidence * (1.0 + x[4] * data[:, 3])

        def cost(x: np.ndarray, squared: np.ndarray = squared) -> float:
            # A few gross errors would set the scale: the gate of a filter removes them anyway
            s = model(x)
            return float(np.mean(2 * np.log(s) + np.minimum(squared / s**2, 25.0))) if (s > 0).all() else math.inf

        best = np.array([math.log(math.sqrt(np.median(squared))), 1.0, 0.0, 0.0, 0.1])
        low, step = cost(best), 0.5
        for k in range(6000):
            trial = best + rng.normal(0.0, step, 5) * (0.5, 0.3, 0.5, 0.3, 0.2)
            trial[2:] = np.maximum(trial[2:], (0.0, -0.98, 0.0))
            value = cost(trial)
            if value < low:
                best, low = trial, value
            step = max(0.02, 0.5 * 0.999**k)
        s = np.exp(best[0])
        z = np.sqrt(squared) / model(best)
        print(f"  |z| p50 {np.median(z):.2f} p95 {np.percentile(z, 95):.2f} p99 {np.percentile(z, 99):.2f}")
        print(f"{name}: sigma {s:.3g}, k1 1.0, k2 {best[1]:.2f}, k3 {best[2]:.2f}, k4 {best[3]:.2f}, k5 {best[4]:.2f};"
              f" rms {rms(list(data[:, column])):.3g}")  # fmt: skip


if __name__ == "__main__":
    cv2.setNumThreads(1)
    commands = {"speed": speed, "grid": grid, "approaches": approaches, "gate": gate, "fit": fit}
    for name in sys.argv[1:] or ["speed"]:
        if name not in commands:
            sys.exit(__doc__)
        commands[name]()
