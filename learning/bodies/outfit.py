"""Random clothes and hair: loose cloth stands off the skin, skirts and long hair are added."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from learning.bodies.rigged import INDEX, FloatArray, RiggedBody
from learning.segments import SEGMENTS

_TRUNK = ("spine", "chest", "left_collar", "right_collar")
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Outfit:
    """Clothes and hair of a person.

    ``sleeve`` is where the sleeves end: 0 at the shoulder, 1 at the elbow, 2 at the wrist;
    ``trouser`` likewise from the hip (0) over the knee (1) to the ankle (2). ``hem_m`` is the
    height of the shirt's hem above the hip joints. ``loose_m``, ``wide_m`` and ``hair_m`` are how
    far shirt, trousers and hair stand off; ``skirt_m`` is how far the hem of a skirt stands off,
    0 without a skirt; ``tail_m`` is how far a loose shirt hangs below the hip joints, if it does;
    ``long_hair_m`` is the length of hair down the neck.
    """

    sleeve: float = 0.5
    trouser: float = 1.9
    hem_m: float = 0.0
    loose_m: float = 0.0
    wide_m: float = 0.0
    hair_m: float = 0.0
    skirt_m: float = 0.0
    tail_m: float = 0.0
    long_hair_m: float = 0.0


def draw_outfit(rng: np.random.Generator, sex: str, dressed: bool) -> Outfit:
    """Return random clothes.

    Args:
        rng: source of chance.
        sex: "male" or "female"; skirts and long hair are rare in men.
        dressed: the mesh already has clothes and hair, so that less is added.
    """
    skirts, hair = {"male": (0.0, 0.1), "female": (0.3, 0.5)}[sex]
    if dressed:
        skirts, hair = skirts / 10, 0.0
    has_skirt, has_long_hair = rng.random() < skirts, rng.random() < hair
    has_tail = not dressed and rng.random() < 0.5
    sleeve = rng.choice([rng.uniform(0.3, 0.9), rng.uniform(0.9, 1.5), rng.uniform(1.8, 1.97)])
    return Outfit(
        sleeve=float(sleeve),
        trouser=float(rng.uniform(0.7, 1.2) if rng.random() < 0.2 else rng.uniform(1.7, 1.97)),
        hem_m=float(rng.uniform(-0.12, 0.1)),
        loose_m=float(rng.uniform(0.0, 0.02 if dressed else 0.04)),
        wide_m=float(rng.uniform(0.0, 0.01 if dressed else 0.025)),
        hair_m=float(rng.uniform(0.0, 0.02) if dressed else rng.uniform(0.003, 0.05)),
        skirt_m=float(rng.uniform(0.02, 0.2)) if has_skirt else 0.0,
        tail_m=float(rng.uniform(0.02, 0.2)) if has_tail else 0.0,
        long_hair_m=float(rng.uniform(0.1, 0.35)) if has_long_hair else 0.0,
    )


def wearing(body: RiggedBody, outfit: Outfit, rng: np.random.Generator) -> RiggedBody:
    """Return the body in clothes and with hair; the folds of the cloth are random."""
    shirt = outfit.loose_m * shirt_of(body, outfit) * _folds(body.vertices, rng)
    legs = outfit.wide_m * trousers_of(body, outfit) * _folds(body.vertices, rng)
    off = (shirt + legs)[:, None] * _normals(body)
    head = body.vertices - body.head_centre
    away = head / np.maximum(np.linalg.norm(head, axis=1, keepdims=True), 1e-6)
    off += (outfit.hair_m * hair_of(body) * _folds(body.vertices, rng))[:, None] * away
    changed = replace(body, vertices=(body.vertices + off).astype(np.float32))
    hip, knee = body.joints[0, 2], body.joints[INDEX["left_shin"], 2]
    if outfit.skirt_m:
        changed = _with_cloth(changed, (hip + 0.1, knee - 0.05), outfit.skirt_m)
    elif outfit.tail_m:
        changed = _with_cloth(changed, (hip + 0.15, hip - outfit.tail_m), outfit.loose_m)
    if outfit.long_hair_m:
        changed = _with_long_hair(changed, outfit, rng)
    return changed


def along_limbs(body: RiggedBody, upper: str, lower: str, end: str) -> FloatArray:
    """Return how far down its limb each vertex is, (v,): 0, 1 and 2 at the limb's joints.

    Args:
        body: the body.
        upper: segment between 0 and 1 without its side, as "upper_arm".
        lower: segment between 1 and 2.
        end: segment that begins at 2. Vertices of other segments get -1.
    """
    reached = np.full(len(body.vertices), -1.0, np.float32)
    for side in _SIDES:
        first, second, last = (INDEX[f"{side}_{part}"] for part in (upper, lower, end))
        for segment, following, start in ((first, second, 0.0), (second, last, 1.0)):
            mine = body.part == segment
            bone = body.joints[following] - body.joints[segment]
            share = (body.vertices[mine] - body.joints[segment]) @ bone / (bone @ bone)
            reached[mine] = start + np.clip(share, 0, 1)
        reached[body.part == last] = 2.0
    return reached


def shirt_of(body: RiggedBody, outfit: Outfit) -> FloatArray:
    """Return how far (0..1) the shirt covers each vertex, (v,), with soft edges."""
    weights = body.weights
    down = along_limbs(body, "upper_arm", "forearm", "hand")
    arms = sum(
        weights[:, INDEX[f"{side}_{part}"]] for side in _SIDES for part in ("upper_arm", "forearm")
    )
    hem = body.joints[0, 2] + outfit.hem_m
    trunk = weights[:, [INDEX[name] for name in _TRUNK]].sum(axis=1)
    trunk = trunk + weights[:, 0] * _ramp(body.vertices[:, 2], hem - 0.02, hem + 0.01)
    collar = np.linalg.norm(body.vertices - body.joints[INDEX["neck"]], axis=1)
    trunk = trunk * _ramp(collar, 0.06, 0.14)
    sleeves = 0.7 * arms * _ramp(-down, -outfit.sleeve - 0.05, -outfit.sleeve)
    return np.asarray(trunk + sleeves, np.float32)


def trousers_of(body: RiggedBody, outfit: Outfit) -> FloatArray:
    """Return how far (0..1) the trousers cover each vertex, (v,), with soft edges."""
    weights = body.weights
    down = along_limbs(body, "thigh", "shin", "foot")
    legs = sum(weights[:, INDEX[f"{side}_{part}"]] for side in _SIDES for part in ("thigh", "shin"))
    hips = weights[:, 0] * _ramp(-body.vertices[:, 2], -body.joints[0, 2] - 0.05, 0.0)
    return np.asarray(
        legs * _ramp(-down, -outfit.trouser - 0.05, -outfit.trouser) + 0.5 * hips, np.float32
    )


def hair_of(body: RiggedBody) -> FloatArray:
    """Return how far (0..1) hair covers each vertex, (v,): top, back and sides of the head."""
    joint = body.joints[INDEX["head"]]
    tall = 2 * (body.head_centre[2] - joint[2])
    up = (body.vertices[:, 2] - joint[2]) / tall
    ahead = (body.vertices[:, 0] - body.head_centre[0]) / tall
    top = _ramp(up, 0.7, 0.8)
    back = _ramp(up, 0.2, 0.35) * _ramp(-ahead, -0.1, 0.05)
    on_head = body.weights[:, INDEX["head"]]
    return np.asarray(on_head * np.maximum(top, back), np.float32)


def _ramp(value: NDArray[np.floating], low: float, high: float) -> NDArray[np.floating]:
    """Return 0 below ``low``, 1 above ``high``, and a straight line between."""
    return np.asarray(np.clip((value - low) / max(high - low, 1e-6), 0.0, 1.0))


def _folds(points: FloatArray, rng: np.random.Generator) -> NDArray[np.floating]:
    """Return smooth random factors between 0.4 and 1 for points, (v,)."""
    waves = [np.sin(points @ rng.normal(0.0, 12.0, 3) + rng.uniform(0, 6.3)) for _ in range(3)]
    return np.asarray(0.7 + 0.1 * np.sum(waves, axis=0))


def _normals(body: RiggedBody) -> NDArray[np.floating]:
    """Return the outward direction at each vertex, (v, 3); 0 where faces cancel out."""
    corners = body.vertices[body.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(body.vertices)
    for corner in range(3):
        np.add.at(normals, body.faces[:, corner], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(length, 1e-9))


def _with_cloth(body: RiggedBody, ends_m: tuple[float, float], flare_m: float) -> RiggedBody:
    """Return the body with a skirt, or the tail of a shirt, that the thighs push.

    Args:
        body: the body.
        ends_m: heights at rest of the top and of the hem.
        flare_m: how far the hem stands off.
    """
    top, hem = ends_m
    share = np.linspace(0.0, 1.0, 24)[:, None]
    angle = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)[None, :]
    levels = top + share * (hem - top)
    middle, deep, wide = _girths(body, levels[:, 0]).T[:, :, None]
    wave = 1 + 0.03 * share * np.sin(11 * angle)
    out = 0.01 + flare_m * share
    x = middle + (deep + out) * np.cos(angle) * wave
    y = (wide + out) * np.sin(angle) * wave
    z = np.broadcast_to(levels, x.shape)
    weights = np.zeros((x.size, len(SEGMENTS)), np.float32)
    left = np.broadcast_to(0.5 + 0.5 * np.sin(angle), x.shape).ravel()
    hip, knee = body.joints[0, 2], body.joints[INDEX["left_shin"], 2]
    legs = 0.8 * _ramp(-z.ravel(), -hip, -knee)
    weights[:, 0] = 1 - legs
    weights[:, INDEX["left_thigh"]] = legs * left
    weights[:, INDEX["right_thigh"]] = legs * (1 - left)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return body.with_mesh(points.astype(np.float32), _tube(*x.shape), weights)


def _girths(body: RiggedBody, levels: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return middle (x), half depth and half width of the trunk, (n, 3), from the top down.

    Cloth does not follow the body inward below its widest level, nor below the hip joints.
    """
    belly = np.isin(body.part, [0, INDEX["spine"], INDEX["left_thigh"], INDEX["right_thigh"]])
    trunk = body.vertices[belly]
    sizes = []
    for level in np.maximum(levels, body.joints[0, 2]):
        near = trunk[np.argsort(np.abs(trunk[:, 2] - level))[: max(len(trunk) // 40, 6)], :2]
        low, high = near.min(axis=0), near.max(axis=0)
        sizes.append([(low[0] + high[0]) / 2, (high[0] - low[0]) / 2, (high[1] - low[1]) / 2])
    grown = np.array(sizes)
    grown[:, 1:] = np.maximum.accumulate(grown[:, 1:], axis=0)
    return grown


def _with_long_hair(body: RiggedBody, outfit: Outfit, rng: np.random.Generator) -> RiggedBody:
    """Return the body with hair down its neck: an open tube behind the face, or a tail."""
    joint = body.joints[INDEX["head"]]
    size = body.head_centre[2] - joint[2]
    skull = body.vertices[body.weights[:, INDEX["head"]] > 0.9]
    wide = (skull[:, 1].max() - skull[:, 1].min()) / 2 * rng.uniform(0.3, 1.1)
    behind = skull[skull[:, 2] > body.head_centre[2]][:, 0].min()
    share = np.linspace(0.0, 1.0, 12)[:, None]
    angle = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)[None, :]
    fat = np.sqrt(np.sin(np.pi * np.clip(0.12 + 0.8 * share, 0, 1)))
    x = behind + 0.35 * size + 0.55 * size * fat * np.cos(angle) - 0.02 * share
    y = wide * fat * np.sin(angle)
    z = np.broadcast_to(body.head_centre[2] + size / 2 - share * outfit.long_hair_m, x.shape)
    weights = np.zeros((x.size, len(SEGMENTS)), np.float32)
    chest = np.broadcast_to(0.5 * share**2, x.shape).ravel()
    weights[:, INDEX["head"]], weights[:, INDEX["chest"]] = 1 - chest, chest
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return body.with_mesh(points.astype(np.float32), _tube(*x.shape), weights)


def _tube(rings: int, around: int) -> NDArray[np.int32]:
    """Return the triangles of a tube of rings, the first on top, seen from outside."""
    ring, step = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = ring * around + step, ring * around + (step + 1) % around
    below, beside = a + around, b + around
    faces = [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, below, b), (b, below, beside))]
    return np.concatenate(faces).astype(np.int32)
