"""A second implementation of the yardstick phantom in numpy, as a reference for `tomofield
simulate`.

The recipe is described in src/simulate/phantom.h. Lengths are voxels; positions are (X, Y, Z) about
the centre of the volume."""

import numpy as np
import scipy.special

LARGEST_DENSITY = 0.2 + 0.98  # of a wall in the slab; all densities are divided by it
SLAB = 0.2 / LARGEST_DENSITY


def centres(count):
    """Returns the positions of voxel or pixel centres about the middle."""
    return np.arange(count) - (count - 1) / 2


class Cell:
    """Holds a slab with hollow ellipsoids and blobs. Each ellipsoid is a dict with the keys of
    phantom.json, each blob a row (X, Y, Z, sigma, peak)."""

    def __init__(self, size, thickness, is_extended, bodies, blobs=()):
        self.size, self.thickness, self.is_extended = size, thickness, is_extended
        self.bodies, self.blobs = bodies, blobs

    def truth(self):
        """Returns the density [z, y, x] at the voxel centres."""
        across, along_z = centres(self.size), centres(self.thickness)
        density = np.full((self.thickness, self.size, self.size), SLAB)
        for body in self.bodies:
            z, y, x = (near(axis, middle, body["radius_px"]) for axis, middle in
                       zip((along_z, across, across), body["center_px"][::-1]))
            offsets = np.stack(np.meshgrid(along_z[z], across[y], across[x], indexing="ij")[::-1], -1)
            form = quadratic_form(matrix(body), offsets - body["center_px"])
            density[z, y, x] += np.select(
                [form < body["inner_to_outer_ratio"] ** 2, form < 1],
                [body["inside_density"], body["wall_density"]], 0)
        for *middle, sigma, peak in self.blobs:
            boxes = [near(axis, m, 6.5 * sigma) for axis, m in
                     zip((along_z, across, across), middle[::-1])]
            z, y, x = (gaussian(axis[box] - m, sigma) for axis, box, m in
                       zip((along_z, across, across), boxes, middle[::-1]))
            density[tuple(boxes)] += peak * z[:, None, None] * y[:, None] * x
        return density

    def view(self, tilt_deg):
        """Returns the line integrals [y, x] of one view. A ray through pixel (u, y) meets the
        points (u cos - s sin, y, u sin + s cos) for every s."""
        angle = np.radians(tilt_deg)
        cos, sin = np.cos(angle), np.sin(angle)
        pixels = centres(self.size)
        image = np.tile(SLAB * self.slab_lengths(pixels, cos, sin), (self.size, 1))
        direction = np.array([-sin, 0, cos])
        for body in self.bodies:
            middle, radius = np.array(body["center_px"]), body["radius_px"]
            columns = near(pixels, middle[0] * cos + middle[2] * sin, radius)
            rows = near(pixels, middle[1], radius)
            y, u = np.meshgrid(pixels[rows], pixels[columns], indexing="ij")
            start = np.stack([u * cos, y, u * sin], -1) - middle
            outer = chord_lengths(matrix(body), start, direction, 1)
            inner = chord_lengths(matrix(body), start, direction, body["inner_to_outer_ratio"])
            image[rows, columns] += (body["wall_density"] * (outer - inner)
                                     + body["inside_density"] * inner)
        for *middle, sigma, peak in self.blobs:
            columns = near(pixels, middle[0] * cos + middle[2] * sin, 6.5 * sigma)
            rows = near(pixels, middle[1], 6.5 * sigma)
            u = pixels[columns]
            # The ray's distances from the faces of the slab to its point nearest to the blob.
            nearest = middle[2] * cos - middle[0] * sin
            ends = [(face - u * sin) / cos - nearest for face in (-self.thickness / 2, self.thickness / 2)]
            lengths = np.subtract(*(scipy.special.ndtr(end / sigma) for end in ends[::-1]))
            across = gaussian(u - middle[0] * cos - middle[2] * sin, sigma) * lengths
            image[rows, columns] += (peak * sigma * np.sqrt(2 * np.pi)
                                     * gaussian(pixels[rows] - middle[1], sigma)[:, None] * across)
        return image

    def slab_lengths(self, pixels, cos, sin):
        """Returns the length of each pixel's ray within the slab, which ends at the faces of the
        cube unless the specimen is extended."""
        if self.is_extended:
            return np.full(len(pixels), self.thickness / cos)
        first, last = np.full(len(pixels), -np.inf), np.full(len(pixels), np.inf)
        for start, step, half in ((pixels * cos, -sin, self.size / 2),
                                  (pixels * sin, cos, self.thickness / 2)):
            if abs(step) < 1e-12:  # parallel to these faces, and every pixel lies between them
                continue
            ends = np.sort([(-half - start) / step, (half - start) / step], axis=0)
            first, last = np.maximum(first, ends[0]), np.minimum(last, ends[1])
        return np.maximum(last - first, 0)

    def views(self, tilts):
        return np.array([self.view(tilt) for tilt in tilts])

    def noise_sigma(self, noise, tilts):
        """Returns the standard deviation of the noise: a part of the range of the flattest view."""
        flattest = self.view(min(tilts, key=abs))
        return noise * np.subtract(*np.percentile(flattest, [99.5, 0.5]))


def near(axis, middle, radius):
    """Returns the slice of the axis within a radius of a position."""
    return slice(*np.searchsorted(axis, [middle - radius, middle + radius]))


def gaussian(offset, sigma):
    return np.exp(-0.5 * (offset / sigma) ** 2)


def matrix(body):
    """Returns Q of the outer surface p^T Q p = 1."""
    return np.asarray(body["q"])


def quadratic_form(q, points):
    return np.einsum("...i,ij,...j->...", points, q, points)


def chord_lengths(q, start, direction, scale):
    """Returns the lengths of the rays start + s * direction within the surface scaled by
    `scale`."""
    a = direction @ q @ direction
    b = start @ q @ direction
    discriminant = b**2 - a * (quadratic_form(q, start) - scale**2)
    return 2 * np.sqrt(np.maximum(discriminant, 0)) / a


def draw_cell(size, thickness, is_extended, max_tilt_deg, seed):
    """Draws a cell by the recipe, with random numbers of its own."""
    random = np.random.default_rng([seed, 20])
    half, more = size / 2, 1
    if is_extended:
        angle = np.radians(max_tilt_deg)
        half = size / 2 / np.cos(angle) + thickness / 2 * np.tan(angle)
        more = 1.2 * half / (size / 2)
    bodies, spheres = [], np.empty((0, 4))  # the spheres about the bodies: X, Y, Z, radius
    for tries, smallest, largest in ((125, 0.15, 0.4), (2000, 0.05, 0.25)):
        radii = random.uniform(smallest * thickness, largest * thickness, int(tries * more))
        for radius in sorted(radii, reverse=True):
            beyond = 2 * radius if is_extended else 0
            limits = np.array([half, size / 2 + beyond, thickness / 2]) - radius
            center = random.uniform(-limits, limits)
            distances = np.linalg.norm(spheres[:, :3] - center, axis=1)
            if (distances >= spheres[:, 3] + radius).all():
                bodies.append(draw_body(random, center, radius))
                spheres = np.vstack([spheres, [*center, radius]])
    return Cell(size, thickness, is_extended, bodies)


def draw_body(random, center, radius):
    """Draws shape, orientation and densities of an ellipsoid whose longest semi-axis is
    `radius`."""
    axes = random.uniform(0.7 * radius, radius, 3)
    axes[random.integers(3)] = radius
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return {"center_px": center, "radius_px": radius,
            "q": turn @ np.diag(axes**-2.0) @ turn.T,
            "inner_to_outer_ratio": random.uniform(0.85, 0.95),
            "wall_density": random.uniform(0.5, 0.98) / LARGEST_DENSITY,
            "inside_density": random.uniform(0.1, 0.5) / LARGEST_DENSITY}
