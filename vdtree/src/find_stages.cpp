#include "find_stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>

#include "drift.h"
#include "pyramid.h"

namespace unseen::vdtree {

namespace {

constexpr std::size_t side = 128;       // of pictures, in cells
constexpr float margin = 1.05f;         // of the picture around the mesh's sphere: proxies may stand out of it
constexpr std::size_t direction_count = 26;
constexpr double first_share = 0.57;    // of the nodes that the first stage leaves; finer ones are for near views, which go by other bounds
constexpr double stages_per_halving = 2;
constexpr double fewest_left = 4;       // nodes; then all fold
constexpr float outline_contrast = 0.3f; // of a typical outline: what a distance between surfaces changes of the light

// From where a picture is taken: the mesh's sphere fills it, but for the margin.
struct Camera {
    glm::vec3 centre, right, up, towards;
    float cells_per_length;

    glm::vec3 place(const glm::vec3& p) const {
        const glm::vec3 q = (p - centre) * cells_per_length;
        return {glm::dot(q, right) + side / 2.0f, glm::dot(q, up) + side / 2.0f, glm::dot(q, towards)};
    }
};

// Directions of a Fibonacci spiral over the sphere.
Camera camera(const Sphere& sphere, std::size_t number) {
    constexpr float golden_angle = 2.39996323f;
    const float z = 1 - static_cast<float>(2 * number + 1) / direction_count, s = std::sqrt(1 - z * z);
    const float angle = golden_angle * static_cast<float>(number);
    Camera c;
    c.centre = sphere.centre;
    c.towards = {s * std::cos(angle), s * std::sin(angle), z};
    c.right = glm::normalize(glm::cross(std::abs(c.towards.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0), c.towards));
    c.up = glm::cross(c.towards, c.right);
    c.cells_per_length = side / (2 * margin * sphere.radius);
    return c;
}

// Before an unlit background: the light that comes from each cell, and whether the mesh covers it.
struct Picture {
    Plane light{side}, cover{side};

    void subtract(const Picture& other) {
        for (std::size_t i = 0; i < light.values.size(); ++i) {
            light.values[i] -= other.light.values[i];
            cover.values[i] -= other.cover.values[i];
        }
    }
};

class Painter {
public:
    Painter(const VertexTree& tree, const Camera& camera)
        : camera_(camera), positions_(tree.positions()), luminance_(tree.luminance()), height_(side * side, -std::numeric_limits<float>::infinity()) {}

    // The nearest surface at the middle of every cell. Triangles over nodes.
    void draw(std::span<const Triangle> triangles) {
        for (const Triangle& t : triangles)
            draw(t, camera_.place(positions_[t[0]]), camera_.place(positions_[t[1]]), camera_.place(positions_[t[2]]));
    }
    Picture& picture() { return picture_; }

private:
    struct Cells {
        std::size_t first, end;
    };
    // Whose middles lie between the least and the most.
    static Cells between(float a, float b, float c) {
        const float low = std::ceil(std::min({a, b, c}) - 0.5f), high = std::floor(std::max({a, b, c}) - 0.5f) + 1;
        if (!(low < high)) return {0, 0};
        return {static_cast<std::size_t>(std::clamp(low, 0.0f, static_cast<float>(side))),
                static_cast<std::size_t>(std::clamp(high, 0.0f, static_cast<float>(side)))};
    }

    void draw(const Triangle& t, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
        const Cells columns = between(a.x, b.x, c.x), rows = between(a.y, b.y, c.y);
        if (columns.first >= columns.end || rows.first >= rows.end) return; // most, of fine meshes
        const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if (!(std::abs(area) > 0)) return;
        const float of_a = luminance_[t[0]], of_b = luminance_[t[1]], of_c = luminance_[t[2]];
        for (std::size_t y = rows.first; y < rows.end; ++y) {
            for (std::size_t x = columns.first; x < columns.end; ++x) {
                const float px = static_cast<float>(x) + 0.5f - a.x, py = static_cast<float>(y) + 0.5f - a.y;
                const float v = (px * (c.y - a.y) - py * (c.x - a.x)) / area, w = ((b.x - a.x) * py - (b.y - a.y) * px) / area, u = 1 - v - w;
                if (!(u >= 0 && v >= 0 && w >= 0)) continue;
                const std::size_t cell = y * side + x;
                const float height = u * a.z + v * b.z + w * c.z;
                if (!(height > height_[cell])) continue;
                height_[cell] = height;
                picture_.light.values[cell] = u * of_a + v * of_b + w * of_c;
                picture_.cover.values[cell] = 1;
            }
        }
    }

    const Camera& camera_;
    std::span<const glm::vec3> positions_;
    std::span<const Unorm16> luminance_;
    Picture picture_;
    std::vector<float> height_; // towards the eye
};

// A picture in bands of frequency.
class Bands {
public:
    struct Band {
        Plane light, cover;           // less the means
        Plane mean_light, mean_cover; // over wider areas
    };

    explicit Bands(const Picture& picture) {
        Plane light = picture.light, cover = picture.cover;
        for (Band& band : bands_) {
            band.light = std::move(light), band.cover = std::move(cover);
            light = split(band.light, band.mean_light);
            cover = split(band.cover, band.mean_cover);
        }
    }
    const Band& operator[](std::size_t band) const { return bands_[band]; }

private:
    // Takes the mean away; returns the next level.
    static Plane split(Plane& plane, Plane& mean) {
        Plane next = reduce(plane);
        mean = expand(next, plane.side);
        for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] -= mean.values[i];
        return next;
    }

    std::array<Band, FoldStage::band_count> bands_;
};

// Raises the contrasts to those of a difference of pictures.
void include(const Bands& mesh, const Bands& difference, FoldStage& stage) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b) {
        const Bands::Band &whole = mesh[b], &change = difference[b];
        const float inverse_gain = 1 / static_cast<float>(band_gain(b));
        for (std::size_t i = 0; i < change.light.values.size(); ++i) {
            const float light = change.light.values[i], cover = change.cover.values[i];
            if (light == 0 && cover == 0) continue;
            for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k) {
                const float background = FoldStage::backgrounds[k];
                const float mean = std::max(whole.mean_light.values[i] + background * (1 - whole.mean_cover.values[i]), 0.0f);
                const float to_contrast = inverse_gain / (mean + FoldStage::black);
                const float mask = std::abs(whole.light.values[i] - background * whole.cover.values[i]) * to_contrast;
                std::size_t row = 0;
                while (row + 1 < FoldStage::masks.size() && mask >= FoldStage::masks[row + 1]) ++row;
                float& contrast = stage.contrast[k][b][row];
                contrast = std::max(contrast, std::abs(light - background * cover) * to_contrast);
            }
        }
    }
}

class StageFinder {
public:
    StageFinder(const VertexTree& tree, std::span<FoldError> errors)
        : tree_(tree), errors_(errors), interior_(tree.interior_count()), parents_(tree.parents()),
          triangles_(tree.triangles().begin(), tree.triangles().end()) {
        for (Triangle& t : triangles_)
            for (NodeId& corner : t) corner += interior_;
        for (std::size_t i = 0; i < direction_count; ++i) cameras_.push_back(camera(tree.bounding_sphere(), i));
    }

    std::vector<FoldStage> run() {
        const std::size_t count = order();
        std::vector<std::optional<Picture>> pictures(direction_count);
        std::vector<std::optional<Bands>> bands(direction_count);
        for_each_picture([&](std::size_t i, const Picture& picture) {
            pictures[i] = picture;
            bands[i].emplace(picture);
        });
        std::vector<FoldStage> stages(count);
        for (std::size_t stage = 0; stage < count; ++stage) {
            fold(stage);
            std::vector<FoldStage> found(direction_count);
            for_each_picture([&](std::size_t i, Picture& picture) {
                picture.subtract(*pictures[i]);
                include(*bands[i], Bands(picture), found[i]);
            });
            for (const FoldStage& from : found) unite(stages[stage], from);
        }
        return stages;
    }

private:
    // Gives every node its stage; returns how many there are.
    std::size_t order() {
        std::vector<float> light(interior_); // that the fold changes, as the side of a square of it
        for (NodeId node = interior_; node-- > 0;) {
            const FoldError& e = errors_[node];
            const float own = outline_contrast * e.mean_distance + changed_radius(tree_, errors_, node) * e.mean_luminance;
            light[node] = std::max(light[node], own);
            if (node > 0) light[parents_[node]] = std::max(light[parents_[node]], light[node]);
        }
        std::vector<NodeId> sequence(interior_);
        std::iota(sequence.begin(), sequence.end(), NodeId{0});
        std::sort(sequence.begin(), sequence.end(), [&](NodeId a, NodeId b) { return light[a] != light[b] ? light[a] < light[b] : a > b; });
        double left = first_share * interior_;
        std::uint8_t stage = 0;
        for (NodeId folded = 0; folded < interior_; ++folded) {
            while (left >= fewest_left && interior_ - folded <= left) left /= std::exp2(1 / stages_per_halving), ++stage;
            errors_[sequence[folded]].stage = stage;
        }
        return std::size_t{stage} + 1;
    }

    void fold(std::size_t stage) {
        const auto folded = [&](NodeId node) {
            while (parents_[node] != no_node && errors_[parents_[node]].stage <= stage) node = parents_[node];
            return node;
        };
        for (Triangle& t : triangles_)
            for (NodeId& corner : t) corner = folded(corner);
        std::erase_if(triangles_, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
    }

    template <class F>
    void for_each_picture(F&& f) {
        tbb::parallel_for(std::size_t{0}, direction_count, [&](std::size_t i) {
            Painter painter(tree_, cameras_[i]);
            painter.draw(triangles_);
            f(i, painter.picture());
        });
    }

    static void unite(FoldStage& stage, const FoldStage& other) {
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
            for (std::size_t b = 0; b < FoldStage::band_count; ++b)
                for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
                    stage.contrast[k][b][row] = std::max(stage.contrast[k][b][row], other.contrast[k][b][row]);
    }

    const VertexTree& tree_;
    std::span<FoldError> errors_;
    NodeId interior_;
    std::span<const NodeId> parents_;
    std::vector<Triangle> triangles_; // as folded, over nodes
    std::vector<Camera> cameras_;
};

} // namespace

double FoldStage::frequency(std::size_t band) { return nominal_frequency(band) * side / static_cast<double>(margin); }

std::vector<FoldStage> find_stages(const VertexTree& tree, std::span<FoldError> errors) {
    const float radius = tree.bounding_sphere().radius;
    const bool is_translucent = tree.bounds()[VertexTree::root()].flags & translucent_ring;
    if (is_translucent || !(radius > 0) || !std::isfinite(side / (2 * radius))) return {};
    return StageFinder(tree, errors).run();
}

} // namespace unseen::vdtree
