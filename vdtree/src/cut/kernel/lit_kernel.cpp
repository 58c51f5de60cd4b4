#include "cut/kernel/lit_kernel.h"

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// Covers the rounding of some dozens of operations on floats, as a share and as relative luminance.
constexpr float range_rounding = 1e-5f;
constexpr float position_rounding = 1e-6f; // of centres, as a share
constexpr float tiny = 1e-30f;
// Relative luminance; what the least facing and albedo that are not 0 leave of it is still beyond 1.
constexpr float brightest = 1e12f;
constexpr float largest_ratio = 1e15f; // of distances

// How far a light may move for the rates to hold, and what they grow by until then.
// Radians, of directional lights: intensities change by exp(0.5 / 8) at most, 0.129 a unit.
constexpr float longest_turn = 0.5f;
constexpr float intensity_rate = 0.13f, turn_growth = 1.07f;
constexpr float longest_step = 0.1f; // of the distance to the sphere: (1 / (1 - 0.1))^2 - 1 < 2.4 * 0.1; cubed 1.372
constexpr float square_rate = 2.4f, cube_growth = 1.372f, step_growth = 1.3f, arc_rate = 1.02f;
// Largest sine of the sphere's half-angle seen from the light; from nearer by, rates hold for no step at all.
constexpr float steepest_sine = 0.8f;
constexpr float widening_rate = 2.1f; // of the half-angle: 1 / (cosine (1 - longest_step)), with the sine below that
constexpr float longest_highlight_turn = 0.1f; // radians

// What all lanes have of one light.
struct Direction {
    float x, y, z;
    float sine, cosine; // of the half-angle that directions from the sphere's points are within
    float turn, widen;  // rates of the direction and the half-angle
    bool anywhere;
};

UNSEEN_INLINE float squared(float x) { return x * x; }

// Cosines of the angles nearest and farthest from a direction at angle (c, s) within the angle (cg, sg): largest and
// least.
struct Window {
    float largest, least;
    float beyond; // minus the cosine of the nearest angle, where that is beyond 90 degrees; else 0
};
UNSEEN_INLINE Window window(float c, float s, float cg, float sg) {
    const bool all = sg < 0;
    const float near = c * cg + s * sg, far = c * cg - s * sg;
    Window w;
    w.largest = all || c >= cg ? 1.0f : near;
    w.beyond = w.largest < 0 ? -w.largest : 0.0f;
    w.least = all || -c >= cg ? -1.0f : far;
    return w;
}

// The same for directions whose coordinates lie in the lane's box, and which differ from the one given by no more than
// a chord.
struct BoxBounds {
    float largest, least;
};
UNSEEN_INLINE BoxBounds box_bounds(const LitBatch& b, std::size_t i, float x, float y, float z, float chord) {
    const float along = b.axis[0][i] * x + b.axis[1][i] * y + b.axis[2][i] * z;
    float hi = std::max(along, along * b.cosine[i]), lo = std::min(along, along * b.cosine[i]);
    for (std::size_t k = 0; k < 2; ++k) {
        const float t = b.across[k][0][i] * x + b.across[k][1][i] * y + b.across[k][2][i] * z;
        hi += std::max(t * b.least_across[k][i], t * b.largest_across[k][i]);
        lo += std::min(t * b.least_across[k][i], t * b.largest_across[k][i]);
    }
    constexpr float rounding = 2e-6f;
    const bool has_box = b.steepness[i] > 0;
    return {has_box ? hi + chord + rounding : 2.0f, has_box ? lo - chord - rounding : -2.0f};
}
// Between unit vectors at an angle.
UNSEEN_INLINE float chord_of(float sine, float cosine) {
    return sine / std::sqrt(std::max((1 + cosine) * 0.5f, 1e-6f));
}

UNSEEN_INLINE float angle_sine(float ax, float ay, float az, float bx, float by, float bz) {
    return std::sqrt(squared(ay * bz - az * by) + squared(az * bx - ax * bz) + squared(ax * by - ay * bx));
}

// From a sphere's points to a point.
UNSEEN_INLINE Direction towards(const float (&from)[3], float radius, const float (&to)[3], float tree_radius,
                                float& near, float& far) {
    const float x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
    const float distance = std::sqrt(x * x + y * y + z * z), inverse = 1 / std::max(distance, tiny);
    Direction d;
    d.x = x * inverse, d.y = y * inverse, d.z = z * inverse;
    d.anywhere = !(distance > radius);
    near = std::max(distance - radius, tiny);
    far = distance + radius;
    d.sine = std::min(radius * inverse, 1.0f);
    d.cosine = std::sqrt(std::max(0.0f, 1 - d.sine * d.sine));
    d.turn = arc_rate * tree_radius / near;
    d.widen = widening_rate * d.sine * tree_radius / near;
    return d;
}

UNSEEN_INLINE float step_of(float cosine, float outer, float inner) {
    const float t = std::min(std::max((cosine - outer) / (inner - outer), 0.0f), 1.0f);
    return t * t * (3 - 2 * t);
}

// What a light sends to a vertex with the normal n and the albedo r is
//
//     L = I (n.l)+ (r + k (n.h)+^e),      h = (l + v) / |l + v|,
//
// where I is its intensity there, l and v are the directions to the light and to the eye, ()+ is no less than 0, and k
// and e are the highlight's. A node's vertices have normals in a cone (and in a box), albedos in an interval, and places
// in a sphere. L is bounded by the largest and least values of each factor over these. Each factor also has a rate: by how
// much it changes at most while the lights move by 1 (see light_motion()), for moves up to the cap.

// A light as a node's sphere sees it.
struct Beam {
    Direction to;                // the directions to it
    float most, least;           // intensity
    float most_rate, least_rate; // shares of these
    float spread_rate;           // of most * largest albedo - least * least albedo
    float fade_rate;             // of the intensity, by a spot's edge
    float growth;                // of other rates, until the cap
    float cap;                   // moves, as light_motion() counts them
};

// The edge of a spot: which share of the intensity comes through, and how fast that changes.
UNSEEN_INLINE void fade(const KernelLights::Light& light, float largest_albedo, Beam& beam) {
    const Direction& l = beam.to;
    const float c = -(l.x * light.direction[0] + l.y * light.direction[1] + l.z * light.direction[2]);
    const float s = angle_sine(l.x, l.y, l.z, light.direction[0], light.direction[1], light.direction[2]);
    const Window off_axis = window(c, s, l.anywhere ? -1.0f : l.cosine, l.anywhere ? -1.0f : l.sine);
    const float moves = l.turn + l.widen + 1, reach = moves * beam.cap;
    const bool fades =
        !(off_axis.largest + reach <= light.outer_cosine || off_axis.least - reach >= light.inner_cosine);
    beam.fade_rate = fades ? light.fade * moves * beam.most : 0.0f;
    // Rounding of the cosines, where the step is steep.
    const float inexact = 1e-6f * light.fade;
    beam.most *= std::min(step_of(off_axis.largest, light.outer_cosine, light.inner_cosine) + inexact, 1.0f);
    beam.least *= std::max(step_of(off_axis.least, light.outer_cosine, light.inner_cosine) - inexact, 0.0f);
    beam.spread_rate = beam.most_rate * beam.most * largest_albedo; // the step may keep one and lower the other
    if (beam.most <= 2 * inexact && !fades) beam.most_rate = beam.spread_rate = 0;
}

template <LightSource::Kind kind>
UNSEEN_INLINE Beam beam_of(const KernelLights& all, const KernelLights::Light& light, const float (&centre)[3],
                           float radius, float largest_albedo, float least_albedo) {
    Beam beam;
    beam.fade_rate = 0;
    if constexpr (kind == LightSource::Kind::directional) {
        beam.to = {light.direction[0], light.direction[1], light.direction[2], 0, 1, 1, 0, false};
        beam.most = beam.least = light.intensity;
        beam.most_rate = beam.least_rate = intensity_rate;
        beam.spread_rate = intensity_rate * light.intensity * (largest_albedo - least_albedo);
        beam.cap = longest_turn;
        beam.growth = turn_growth;
        return beam;
    }
    float near, far;
    beam.to = towards(centre, radius + light.inexact, light.position, all.radius, near, far);
    // So near that a float would not hold it, a light is as bright as any.
    beam.most = std::min(brightest, light.intensity * squared(std::min(light.distance / near, largest_ratio)));
    beam.least = beam.to.anywhere
                     ? 0.0f
                     : std::min(brightest, light.intensity * squared(std::min(light.distance / far, largest_ratio)));
    beam.most_rate = square_rate * all.radius / near + intensity_rate;
    beam.least_rate = square_rate * all.radius / far + intensity_rate;
    // Both fall with the distance: their difference changes by the difference of the changes.
    beam.spread_rate =
        2 * all.radius * (cube_growth * beam.most * largest_albedo / near - beam.least * least_albedo / far) +
        intensity_rate * (beam.most * largest_albedo - beam.least * least_albedo);
    beam.cap = beam.to.sine > steepest_sine ? 0.0f : longest_step * near / all.radius;
    beam.growth = step_growth;
    if constexpr (kind == LightSource::Kind::spot) fade(light, largest_albedo, beam);
    return beam;
}

// How the lane's normals face a light: the extremes of (n.l)+, and what their rates are made of.
struct LitFacing {
    float most, least;
    float beyond;  // of Window; 0: some of it is lit
    float nearest; // of the least n.l to 0, from either side
    bool faces;    // all of it
    float sine;    // of the half-angle of normals and directions together
    float moves;   // most change of n.l while the lights move by 1
};
UNSEEN_INLINE LitFacing facing_of(const LitBatch& b, std::size_t i, const Direction& l) {
    const float ax = b.axis[0][i], ay = b.axis[1][i], az = b.axis[2][i];
    const float c = ax * l.x + ay * l.y + az * l.z, s = angle_sine(ax, ay, az, l.x, l.y, l.z);
    const float cosine = l.anywhere ? -1.0f : b.cosine[i] * l.cosine - b.sine[i] * l.sine;
    const float sine = l.anywhere ? -1.0f : b.sine[i] * l.cosine + b.cosine[i] * l.sine;
    const Window cone = window(c, s, cosine, sine);
    const BoxBounds box = box_bounds(b, i, l.x, l.y, l.z, l.anywhere ? 4.0f : chord_of(l.sine, l.cosine));
    const float largest = std::min(cone.largest, box.largest), least = std::max(cone.least, box.least);
    return {std::max(largest, 0.0f),
            std::max(least, 0.0f),
            std::max(-largest, 0.0f),
            std::abs(least),
            least > 0,
            sine,
            (l.turn + l.widen) * std::max(b.steepness[i], 1.0f)};
}

// The matt surface: I (n.l)+ r.
UNSEEN_INLINE void add_matt(const Beam& beam, const LitFacing& facing, float least_albedo, LitBatch& b, std::size_t i) {
    const float largest_albedo = b.largest_albedo[i], moves = facing.moves;
    b.hi[i] += beam.most * facing.most * largest_albedo;
    b.lo[i] += beam.least * facing.least * least_albedo;
    const float rise = beam.growth * beam.most * largest_albedo * moves + beam.most_rate * beam.most * largest_albedo +
                       beam.fade_rate * largest_albedo;
    const float full = rise + beam.growth * beam.least * least_albedo * moves +
                       beam.least_rate * beam.least * least_albedo + beam.fade_rate * largest_albedo;
    // How fast the difference of the extremes of n.l changes. If all of it faces the light: by less than 2 sine a radian,
    // or the spread of the box. If some of it faces away: as fast as the largest. If all of it does: not at all.
    const float turning_rate =
        beam.growth * (beam.least * least_albedo *
                           (std::max(2 * std::max(facing.sine, 0.0f), b.spread[i]) * beam.to.turn + 2 * beam.to.widen) +
                       (beam.most * largest_albedo - beam.least * least_albedo) * moves) +
        beam.spread_rate + 2 * beam.fade_rate * largest_albedo;
    const float facing_rate = turning_rate + beam.least_rate * beam.least * least_albedo * (facing.most - facing.least);
    const bool is_dark = facing.beyond > 0;
    b.fine_rate[i] += is_dark ? 0.0f : facing.faces ? facing_rate : rise;
    // Whichever of these it comes to be; with the largest n.l at 1 and beyond, lo alone counts.
    b.rough_rate[i] +=
        std::max(std::max(rise, full - rise), turning_rate + beam.least_rate * beam.least * least_albedo);
    b.fine_sum_rate[i] += is_dark ? 0.0f : facing.faces ? full : rise;
    const float fine_cap = (is_dark ? facing.beyond : facing.nearest) / moves;
    b.full_rate[i] += full;
    b.rise_rate[i] += rise;
    b.fine_cap[i] = std::min(b.fine_cap[i], fine_cap);
    b.cap[i] = std::min(b.cap[i], beam.to.anywhere ? 0.0f : beam.cap);
}

// The highlight: I (n.l)+ k (n.h)+^e. Its steps have no rates: as far as the cap allows them, they are part of the
// jump.
UNSEEN_INLINE void add_highlight(const KernelLights& all, const Beam& beam, const LitFacing& facing,
                                 const float (&centre)[3], float radius, float least_share, LitBatch& b,
                                 std::size_t i) {
    const Direction& l = beam.to;
    const float ax = b.axis[0][i], ay = b.axis[1][i], az = b.axis[2][i];
    float near_eye, far_eye;
    const Direction v = towards(centre, radius + all.eye_inexact, all.eye, all.radius, near_eye, far_eye);
    const float x = l.x + v.x, y = l.y + v.y, z = l.z + v.z;
    const float length = std::sqrt(x * x + y * y + z * z), inverse = 1 / std::max(length, tiny);
    // How far from their sum's direction the sum of two directions can be that differ by these chords from the
    // centre's.
    const auto chord = [](const Direction& d) { return d.anywhere ? 2.0f : chord_of(d.sine, d.cosine); };
    const float chords = chord(l) + chord(v) + 1e-6f;
    // Cosine and sine of the angle between the axis and h.
    const float hc = (ax * x + ay * y + az * z) * inverse, hs = angle_sine(ax, ay, az, x, y, z) * inverse;
    const auto highlight = [&](float total, bool largest) { // (n.h)+^e
        const float sine = total * inverse;
        if (!(sine < 1)) return largest ? 1.0f : 0.0f;
        const float cosine = std::sqrt(1 - sine * sine);
        const Window h =
            window(hc, hs, b.cosine[i] * cosine - b.sine[i] * sine, b.sine[i] * cosine + b.cosine[i] * sine);
        // A float's cosine near 1 is good to a millionth, and the exponent makes more of it.
        const BoxBounds within = box_bounds(b, i, x * inverse, y * inverse, z * inverse, chord_of(sine, cosine));
        const float base = largest ? std::min(std::min(h.largest, within.largest) + 2e-7f, 1.0f)
                                   : std::max(h.least, within.least) - 2e-7f;
        return base > 0 ? std::pow(base, all.shininess) : 0.0f;
    };
    b.hi[i] += all.specular * beam.most * facing.most * highlight(chords, true);
    b.lo[i] += least_share * all.specular * beam.least * facing.least * highlight(chords, false);
    const float all_moves = facing.moves + v.turn + v.widen;
    const float window_cap =
        v.sine > steepest_sine
            ? 0.0f
            : std::min({b.cap[i], longest_step * near_eye / all.radius, longest_highlight_turn / all_moves});
    b.cap[i] = window_cap;
    b.jump[i] += all.specular * beam.most * step_growth * highlight(chords + all_moves * window_cap, true);
}

// One light on one lane.
template <LightSource::Kind kind, bool shines>
UNSEEN_INLINE void add(const KernelLights& all, const KernelLights::Light& light, LitBatch& b, std::size_t i) {
    const float centre[3] = {b.centre[0][i], b.centre[1][i], b.centre[2][i]};
    const float at_centre = std::abs(centre[0]) + std::abs(centre[1]) + std::abs(centre[2]);
    const float radius = b.radius[i] + position_rounding * (at_centre + b.radius[i]);
    // What may be hidden from a light may have none of it, as if nothing were reflected.
    const float least_albedo = light.casts_shadow ? 0.0f : b.least_albedo[i];
    const Beam beam = beam_of<kind>(all, light, centre, radius, b.largest_albedo[i], least_albedo);
    const LitFacing facing = facing_of(b, i, beam.to);
    add_matt(beam, facing, least_albedo, b, i);
    if constexpr (shines) add_highlight(all, beam, facing, centre, radius, light.casts_shadow ? 0.0f : 1.0f, b, i);
}

template <bool shines>
UNSEEN_INLINE void add(const KernelLights& all, const KernelLights::Light& light, LitBatch& b) {
    using Kind = LightSource::Kind;
    switch (light.kind) {
    case Kind::directional:
        for (std::size_t i = 0; i < kernel_lanes; ++i) add<Kind::directional, shines>(all, light, b, i);
        break;
    case Kind::point:
        for (std::size_t i = 0; i < kernel_lanes; ++i) add<Kind::point, shines>(all, light, b, i);
        break;
    case Kind::spot:
        for (std::size_t i = 0; i < kernel_lanes; ++i) add<Kind::spot, shines>(all, light, b, i);
        break;
    }
}

// What the box's bounds need of it; see across_axis().
UNSEEN_INLINE void prepare_box(LitBatch& b, std::size_t i) {
    const float x = b.axis[0][i], y = b.axis[1][i], z = b.axis[2][i];
    const float sign = z < 0 ? -1.0f : 1.0f, a = -1 / (sign + z), xya = x * y * a;
    b.across[0][0][i] = 1 + sign * x * x * a, b.across[0][1][i] = sign * xya, b.across[0][2][i] = -sign * x;
    b.across[1][0][i] = xya, b.across[1][1][i] = sign + y * y * a, b.across[1][2][i] = -y;
    const float short_by = squared(1 - b.cosine[i]);
    const float far0 = squared(std::max(-b.least_across[0][i], b.largest_across[0][i])),
                far1 = squared(std::max(-b.least_across[1][i], b.largest_across[1][i]));
    const float width0 = b.largest_across[0][i] - b.least_across[0][i],
                width1 = b.largest_across[1][i] - b.least_across[1][i];
    // One bound may be the cone's, whose normals are within a chord of the axis, and the other the box's.
    const float mixed = std::sqrt(2 - 2 * b.cosine[i]) + std::sqrt(far0 + far1 + short_by);
    const bool has_box = width0 > 0;
    b.steepness[i] = has_box ? std::sqrt(1 + far0 + far1) : 0.0f;
    b.spread[i] = has_box ? std::max(std::sqrt(squared(width0) + squared(width1) + short_by), mixed) : 0.0f;
}

UNSEEN_INLINE void run(const KernelLights& all, LitBatch& b) {
    for (std::size_t i = 0; i < kernel_lanes; ++i) prepare_box(b, i);
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        b.lo[i] = all.ambient * b.least_albedo[i];
        b.hi[i] = all.ambient * b.largest_albedo[i];
        b.cap[i] = b.fine_cap[i] = 1e30f;
        b.fine_rate[i] = b.rough_rate[i] = b.fine_sum_rate[i] = b.full_rate[i] = b.rise_rate[i] = b.jump[i] = 0;
    }
    for (const KernelLights::Light& light : all.lights) {
        if (all.specular > 0) add<true>(all, light, b);
        else add<false>(all, light, b);
    }
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const float hi = b.hi[i] * (1 + range_rounding) + range_rounding;
        // Cut off at 1, the upper end stands still while the lower one moves.
        b.fine_cap[i] = std::min(b.fine_cap[i], std::max(0.0f, 1 - hi) / std::max(b.rise_rate[i], tiny));
        b.hi[i] = std::min(hi, 1.0f);
        b.lo[i] = std::min(std::max(b.lo[i] * (1 - range_rounding) - range_rounding, 0.0f), 1.0f);
    }
}

UNSEEN_AVX2 void run_avx2(const KernelLights& all, LitBatch& b) { run(all, b); }

} // namespace

KernelLights::KernelLights(const VertexTree& tree, const Lighting& lighting, glm::dvec3 eye_)
    : KernelLights(lighting, eye_, tree.bounds()[VertexTree::root()].ring.radius) {}

KernelLights::KernelLights(const Lighting& lighting, glm::dvec3 eye_, double tree_radius)
    : ambient(static_cast<float>(lighting.ambient)),
      specular(static_cast<float>(lighting.specular * (lighting.shininess + 8) / 8)),
      shininess(static_cast<float>(lighting.shininess)), radius(static_cast<float>(tree_radius)) {
    constexpr double float_rounding = 1e-7;
    const auto size = [](glm::dvec3 v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
    for (int k = 0; k < 3; ++k) eye[k] = static_cast<float>(eye_[k]);
    eye_inexact = static_cast<float>(float_rounding * size(eye_));
    for (const LightSource& from : lighting.lights) {
        Light light{};
        light.kind = from.kind;
        light.casts_shadow = from.casts_shadow;
        for (int k = 0; k < 3; ++k) {
            light.direction[k] = static_cast<float>(from.direction[k]);
            light.position[k] = static_cast<float>(from.position[k]);
        }
        light.intensity = static_cast<float>(from.intensity);
        light.inexact = static_cast<float>(float_rounding * size(from.position));
        light.distance = static_cast<float>(from.distance);
        if (from.kind == LightSource::Kind::spot) {
            light.inner_cosine = static_cast<float>(from.inner_cosine);
            light.outer_cosine = static_cast<float>(from.outer_cosine);
            // 1.5 is the smooth step's steepest slope; the cosine's, within the edge, is a sine.
            const double inner_sine = std::sqrt(1 - from.inner_cosine * from.inner_cosine),
                         outer_sine = std::sqrt(1 - from.outer_cosine * from.outer_cosine);
            const double sine = from.outer_cosine < 0 && from.inner_cosine > 0 ? 1 : std::max(inner_sine, outer_sine);
            light.fade = static_cast<float>(1.5 * sine / (from.inner_cosine - from.outer_cosine));
        }
        lights.push_back(light);
    }
}

void LitBatch::set(std::size_t lane, const VertexCone& cone, const Sphere& sphere) noexcept {
    axis[0][lane] = cone.axis.x, axis[1][lane] = cone.axis.y, axis[2][lane] = cone.axis.z;
    cosine[lane] = cone.cosine, sine[lane] = cone.sine;
    least_albedo[lane] = cone.albedo.lo, largest_albedo[lane] = cone.albedo.hi;
    centre[0][lane] = sphere.centre.x, centre[1][lane] = sphere.centre.y, centre[2][lane] = sphere.centre.z;
    radius[lane] = sphere.radius;

    for (std::size_t k = 0; k < 2; ++k)
        least_across[k][lane] = cone.least_across[k], largest_across[k][lane] = cone.largest_across[k];
}

// Neither has fused operations, so both give the same bits.
void find_ranges(const KernelLights& lights, LitBatch& batch) noexcept {
    if (has_avx2()) run_avx2(lights, batch);
    else run(lights, batch);
}

LuminanceRange lit_range(const Lighting& lighting, const VertexCone& cone, const Sphere& sphere, glm::dvec3 eye) {
    LitBatch batch;
    for (std::size_t i = 0; i < kernel_lanes; ++i) batch.set(i, cone, sphere);
    find_ranges(KernelLights(lighting, eye, 1), batch);
    return {batch.lo[0], batch.hi[0]};
}

} // namespace unseen::vdtree
