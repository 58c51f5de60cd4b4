#include <unseen/vdtree/internal/baked_light.h>

#include <bitset>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/texture_pyramid.h>

namespace unseen::vdtree {

namespace {

constexpr Index most_samples = 65536;
constexpr double least_deviation = 0.01; // standard deviation of relative luminance; less is no shading to speak of
constexpr int refinements = 4;           // of the direction; the last ones change it by thousandths of a degree

struct Sample {
    glm::dvec3 normal;
    double luminance;
};
using Samples = std::vector<Sample>;

double texel_luminance(const TextureView& texture, glm::vec2 uv) {
    const auto texel = [](float at, std::uint32_t size, Wrap wrap) {
        const double place = std::floor(static_cast<double>(at) * size);
        const bool is_far = !(std::abs(place) < 1e15); // then any texel is as good
        return static_cast<std::size_t>(wrapped_texel(is_far ? 0 : static_cast<std::int64_t>(place), size, wrap));
    };
    return linear_luminance(texture.texels[texel(uv.y, texture.height, texture.wrap_v) * texture.width +
                                           texel(uv.x, texture.width, texture.wrap_u)]);
}

// How many directions there are, about: cells of 1/16 in octahedral coordinates.
class DirectionCount {
public:
    void include(PackedNormal n) { cells_.set(static_cast<std::size_t>(cell(n.x) * 32 + cell(n.y))); }
    double count() const { return static_cast<double>(cells_.count()); }

private:
    static int cell(std::int16_t coordinate) { return (coordinate + 32768) >> 11; }
    std::bitset<32 * 32> cells_;
};

// The direction in which luminance grows fastest with the normal, among normals that face `lit` (zero: among all): of
// the plane a + b.n that fits best. Not of unit length.
glm::dvec3 steepest(const Samples& samples, glm::dvec3 lit) {
    const auto faces = [&](const Sample& s) { return lit == glm::dvec3(0) || glm::dot(s.normal, lit) > 0; };
    glm::dvec3 normal(0);
    double luminance = 0, count = 0;
    for (const Sample& s : samples) {
        if (!faces(s)) continue;
        normal += s.normal, luminance += s.luminance, ++count;
    }
    if (count == 0) return glm::dvec3(0);
    normal /= count, luminance /= count;
    glm::dmat3 spread(0);
    glm::dvec3 slope(0);
    for (const Sample& s : samples) {
        if (!faces(s)) continue;
        const glm::dvec3 apart = s.normal - normal;
        spread += glm::outerProduct(apart, apart);
        slope += (s.luminance - luminance) * apart;
    }
    const double trace = spread[0][0] + spread[1][1] + spread[2][2];
    if (!(trace > 1e-6 * count)) return glm::dvec3(0);              // a plane
    return glm::inverse(spread + glm::dmat3(1e-6 * trace)) * slope; // where the normals lie in a plane, within it
}

// R^2 of the best a + b max(0, n.direction); 0 where b is not above 0, or luminance hardly differs.
double share_explained(const Samples& samples, glm::dvec3 direction) {
    const auto facing = [&](const Sample& s) { return std::max(0.0, glm::dot(s.normal, direction)); };
    double x = 0, y = 0;
    for (const Sample& s : samples) x += facing(s), y += s.luminance;
    const auto count = static_cast<double>(samples.size());
    x /= count, y /= count;
    double xx = 0, xy = 0, yy = 0;
    for (const Sample& s : samples) {
        const double dx = facing(s) - x, dy = s.luminance - y;
        xx += dx * dx, xy += dx * dy, yy += dy * dy;
    }
    if (!(yy > least_deviation * least_deviation * count) || !(xx > 0) || !(xy > 0)) return 0;
    return xy * xy / (xx * yy);
}

} // namespace

Result<BakedLight> find_baked_light(const VertexTree& given) {
    const auto sound = SoundTree::of(given);
    if (!sound) return sound.error();
    const TextureView texture = given.texture();
    if (given.colours().empty() && texture.empty()) return BakedLight();

    Samples samples;
    DirectionCount directions;
    const Index stride = given.leaf_count() / most_samples + 1;
    for (WedgeId leaf = given.interior_wedge_count(); leaf < given.wedge_count();
         leaf += std::min(stride, given.wedge_count() - leaf)) {
        const PackedNormal packed = given.normals()[leaf];
        const glm::dvec3 normal{glm::vec3(packed)};
        if (normal == glm::dvec3(0)) continue;
        const double albedo = static_cast<double>(albedo_of(given, leaf));
        samples.push_back({normal, texture.empty() ? albedo : albedo * texel_luminance(texture, given.uvs()[leaf])});
        directions.include(packed);
    }
    constexpr double parameters = 4; // a, and b times the direction
    if (directions.count() <= parameters) return BakedLight();

    glm::dvec3 direction(0);
    for (int i = 0; i <= refinements; ++i) {
        const glm::dvec3 better = steepest(samples, direction);
        if (!(glm::length(better) > 0)) break;
        direction = glm::normalize(better);
    }
    const double explained =
        1 - (1 - share_explained(samples, direction)) * (directions.count() - 1) / (directions.count() - parameters);
    if (!(explained > 0)) return BakedLight();
    return BakedLight{glm::vec3(direction), explained};
}

} // namespace unseen::vdtree
