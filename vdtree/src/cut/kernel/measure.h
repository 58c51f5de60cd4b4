// Distances, angles and heights: where nodes are, seen from the eye, and within which distances they unfold.

// A node counts as hidden if a sphere of this many radii of its ring is: triangles that it shares with folded neighbours
// reach beyond the ring, by no more than their own size.
constexpr float occluded_radii = 2;

// From so many radii over the distance on, an eye counts as inside the sphere: nearer its half angle would go by the
// rounding of the distance.
constexpr float nearly_inside = 0.95f;

// Angles of points from a unit direction, given their vectors to the eye and their distances; error below 1e-6 radians.
UNSEEN_INLINE Floats angle_from(const float (&gaze)[3], const Floats (&to_eye)[3], const Floats& distance) {
    const Floats inverse = 1 / max_of(distance, all(least_length));
    Floats ahead{}, behind{}; // squares of the ways to the direction, and to its opposite, on the unit sphere
    for (int k = 0; k < 3; ++k) {
        const Floats back = to_eye[k] * inverse, sum = back + gaze[k], difference = back - gaze[k];
        ahead += sum * sum, behind += difference * difference;
    }
    const Ints is_behind = behind < ahead;
    const Floats angle = angle_of_versine(0.5f * min_of(ahead, behind));
    return is_behind ? pi - angle : angle;
}

// Entries of a table at rows and bins, looked up lane by lane.
UNSEEN_INLINE Floats entries(const KernelView& view, const float* table, const Ints& rows, const Ints& bins) {
    const Ints at = view.bins == 1 ? rows : rows * view.bins + bins;
    return collect<Floats>([&](std::size_t lane)
                               UNSEEN_INLINE_LAMBDA { return table[static_cast<std::uint32_t>(at[lane])]; });
}
// The distances of rows at bins.
UNSEEN_INLINE Floats distances(const KernelView& view, const Ints& rows, const Ints& bins, const Floats& lengths) {
    // A length of 0 times infinity is NaN.
    return max_of(lengths, all(least_length)) * view.inverse_threshold *
           entries(view, view.switch_distance.data(), rows, bins);
}

// What is tested: spheres, lengths, and rows of the criterion's table.
struct Nodes {
    Floats centre[3], radius, length, silhouette_length; // the radius with the eyes' spread
    Floats reach;                                        // beyond the radius
    Ints interior_row, silhouette_row;
};
// How that looks from the eye.
struct Measures {
    Floats to_eye[3];            // from the centre
    Floats distance;             // of the centre
    Floats gap;                  // of the sphere: distance - radius
    Floats angle;                // radians, of the centre from the gaze; 0 without one
    Floats eccentricity;         // radians, of the sphere's nearest point; 0 from nearly_inside on, and without gaze
    Ints bin;                    // of eccentricity
    Floats interior, silhouette; // the distances within which the node unfolds
    Floats height;               // of the sphere's top over the lowest plane of the best frustum
    Floats uncovered; // how far it stands out from behind the best occluder; negative, like heights: out of sight
    Ints is_inside;   // in sight
    Ints is_near;     // within the interior's distance
    Ints is_asked;    // the verdict depends on what it faces
};

// By how much nodes stand out from behind the occluder that hides most of them. A sphere around c is hidden by one of
// radius R around b where, for some point q on the way from the eye to c, a share t of it, |q - b| + t r <= R: on the
// way to each of its points a point as near to q lies in the occluder. The least excess over R, over all t, changes by
// no more than the eye's path, and grows with spheres that nest.
UNSEEN_INLINE Floats uncovered(const KernelView& view, const Measures& m, const Floats& node_radius) {
    const Floats distance = max_of(m.distance, all(least_length)), inverse = 1 / distance;
    const Floats ray[3] = {-m.to_eye[0] * inverse, -m.to_eye[1] * inverse, -m.to_eye[2] * inverse};
    const Floats sine = occluded_radii * node_radius * inverse; // t r over the way to q
    const Floats slope = sine / root_of(max_of(1 - sine * sine, all(least_length)));
    Floats least = all(huge);
    for (const KernelView::Occluder& o : view.occluders) {
        const float(&b)[3] = o.towards;
        const Floats along = b[0] * ray[0] + b[1] * ray[1] + b[2] * ray[2];
        const Floats x = b[1] * ray[2] - b[2] * ray[1], y = b[2] * ray[0] - b[0] * ray[2],
                     z = b[0] * ray[1] - b[1] * ray[0];
        const Floats beside_squared = x * x + y * y + z * z;
        const Floats way = min_of(max_of(along - root_of(beside_squared) * slope, all(0)), m.distance); // to the best q
        const Floats off = along - way;
        least = min_of(least, root_of(off * off + beside_squared) + way * sine - o.radius);
    }
    return least + view.spread; // from the eye that sees most of it
}

// Height of a point, given its vector to the eye, over the lowest plane of the best frustum.
UNSEEN_INLINE Floats height(const KernelView& view, const Floats (&to_eye)[3]) {
    Floats best = all(view.planes.empty() ? huge : -huge);
    for (std::size_t f = 0; f + 1 < view.first_plane.size(); ++f) {
        Floats lowest = all(huge);
        for (std::size_t p = view.first_plane[f]; p < view.first_plane[f + 1]; ++p) {
            const KernelView::Plane& plane = view.planes[p];
            lowest = min_of(lowest, plane.offset - (to_eye[0] * plane.normal[0] + to_eye[1] * plane.normal[1] +
                                                    to_eye[2] * plane.normal[2]));
        }
        best = max_of(best, lowest);
    }
    return best;
}

UNSEEN_INLINE Measures measures_of(const KernelView& view, const Nodes& of) {
    Measures m;
    Floats* const e = m.to_eye;
    for (int k = 0; k < 3; ++k) e[k] = (view.eye_high[k] - of.centre[k]) + view.eye_low[k];
    m.distance = root_of(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    m.gap = m.distance - of.radius;
    m.bin = Ints{};
    m.angle = m.eccentricity = all(0);
    if (view.has_gaze) {
        const Floats inverse = 1 / max_of(m.distance, all(least_length));
        const Floats half_angle = pi / 2 - angle_of_cosine(of.radius * inverse);
        m.angle = angle_from(view.gaze, m.to_eye, m.distance);
        const Floats eccentricity = max_of(m.angle - half_angle, all(0));
        m.eccentricity = of.radius < nearly_inside * m.distance ? eccentricity : all(0);
        m.bin = __builtin_convertvector(
            min_of(m.eccentricity * view.bins_per_radian, all(static_cast<float>(view.bins - 1))), Ints);
    }
    m.interior = distances(view, of.interior_row, m.bin, of.length);
    m.silhouette =
        view.nobody ? m.interior : max_of(m.interior, distances(view, of.silhouette_row, m.bin, of.silhouette_length));

    const Ints is_kept = of.silhouette_length >= all(kept_length); // wherever it is
    const Floats own_radius = of.radius - view.spread + of.reach;  // frusta are where they are
    m.height = is_kept ? all(huge) : height(view, m.to_eye) + own_radius;
    m.uncovered = all(huge);
    // Far nodes fold anyway.
    if (!view.occluders.empty() && (view.everybody || any(m.gap < m.silhouette)))
        m.uncovered = is_kept ? m.uncovered : uncovered(view, m, own_radius);

    m.is_inside = (m.height >= 0) & (m.uncovered >= 0);
    m.is_near = m.gap < m.interior;
    m.is_asked = view.everybody ? m.is_inside : m.is_inside & (m.gap < m.silhouette);
    if (!view.near_ones_too && !view.everybody) m.is_asked &= ~m.is_near;
    if (view.nobody) m.is_asked = Ints{};
    return m;
}
