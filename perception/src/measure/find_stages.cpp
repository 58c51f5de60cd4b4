#include "measure/find_stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include "measure/luminance_bias.h"
#include "measure/pyramid.h"
#include <vdtree/internal/simd.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

using namespace measurement;
constexpr std::size_t side = stage_side;
constexpr std::size_t samples = side * cell_samples;
constexpr float margin = stage_margin;

// From where a picture is taken: the mesh's sphere fills it, but for the margin. Lengths are in samples.
struct Camera {
    glm::vec3 centre, right, up, towards;
    float samples_per_length;

    glm::vec3 place(const glm::vec3& p) const {
        const glm::vec3 q = (p - centre) * samples_per_length;
        return {glm::dot(q, right) + samples / 2.0f, glm::dot(q, up) + samples / 2.0f, glm::dot(q, towards)};
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
    c.right =
        glm::normalize(glm::cross(std::abs(c.towards.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0), c.towards));
    c.up = glm::cross(c.towards, c.right);
    c.samples_per_length = samples / (2 * margin * sphere.radius);
    return c;
}

// Before an unlit background: the light that comes from each cell, and the share of it that the mesh covers.
struct Picture {
    Raster light{side}, cover{side};

    void subtract(const Picture& other) {
        for (std::size_t i = 0; i < light.values.size(); ++i) {
            light.values[i] -= other.light.values[i];
            cover.values[i] -= other.cover.values[i];
        }
    }
};

// The nearest surface at a sample.
struct Surface {
    float height = -std::numeric_limits<float>::infinity(); // towards the eye
    float light = 0;
};

class Painter {
public:
    // The surfaces' memory is used again.
    Painter(const VertexTree& tree, const Camera& camera, std::vector<Surface>& surfaces)
        : camera_(camera), positions_(tree.positions()), luminance_(tree.luminance()), closedness_(tree.closedness()),
          surfaces_(surfaces) {
        surfaces_.assign(samples * samples, {});
    }

    // Triangles over nodes.
    Picture draw(std::span<const Triangle> triangles) {
        for (const Triangle& t : triangles)
            draw(t, camera_.place(positions_[t[0]]), camera_.place(positions_[t[1]]), camera_.place(positions_[t[2]]));
        Picture picture;
        constexpr float share = 1.0f / (cell_samples * cell_samples);
        for (std::size_t cell = 0; cell < side * side; ++cell) {
            const Surface* const first =
                surfaces_.data() + cell / side * cell_samples * samples + cell % side * cell_samples;
            float light = 0, covered = 0;
            for (std::size_t y = 0; y < cell_samples; ++y) {
                for (std::size_t x = 0; x < cell_samples; ++x) {
                    const Surface& at = first[y * samples + x];
                    light += at.light;
                    covered += at.height > Surface{}.height ? 1.0f : 0.0f;
                }
            }
            picture.light.values[cell] = share * light;
            picture.cover.values[cell] = share * covered;
        }
        return picture;
    }

private:
    // How many samples of a row, or rows, lie before a place: the rounding of floats that every processor has.
    static std::size_t count_before(float place) {
        if (!(place > 0)) return 0;
        if (place >= samples) return samples;
        const int whole = static_cast<int>(place);
        return static_cast<std::size_t>(whole + (static_cast<float>(whole) < place));
    }
    // Of a row's samples: edges that run up meet them one after the other, not all of a column at once.
    static float offset_of_row(std::size_t row) {
        constexpr float golden_ratio = 0.618034f;
        const float all = golden_ratio * static_cast<float>(row);
        return all - static_cast<float>(static_cast<int>(all));
    }

    void draw(const Triangle& t, const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
        const std::size_t first = count_before(std::min({a.y, b.y, c.y}) - 0.5f),
                          end = count_before(std::max({a.y, b.y, c.y}) - 0.5f);
        if (first >= end) return; // many, of fine meshes
        const float left = std::min({a.x, b.x, c.x}), right = std::max({a.x, b.x, c.x});
        const float inverse = 1 / ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
        if (!std::isfinite(inverse) || (closedness_ == Closedness::closed_outward && inverse < 0) ||
            (closedness_ == Closedness::closed_inward && inverse > 0)) // as renderers do
            return;
        const float of_a = luminance_[t[0]], of_b = luminance_[t[1]], of_c = luminance_[t[2]];
        const glm::vec2 v_by = inverse * glm::vec2(c.y - a.y, a.x - c.x),
                        w_by = inverse * glm::vec2(a.y - b.y, b.x - a.x);
        for (std::size_t y = first; y < end; ++y) {
            // Of a corner's weight, as it grows along the row: where it is no longer, or not yet, negative.
            const float offset = offset_of_row(y), py = static_cast<float>(y) + 0.5f - a.y;
            float low = left - a.x, high = right - a.x;
            for (const auto& [at_start, by] : {std::pair(py * v_by.y, v_by.x), std::pair(py * w_by.y, w_by.x),
                                               std::pair(1 - py * (v_by.y + w_by.y), -v_by.x - w_by.x)}) {
                if (by > 0) low = std::max(low, -at_start / by);
                else if (by < 0) high = std::min(high, -at_start / by);
                else if (at_start < 0) high = low;
            }
            Surface* const row = surfaces_.data() + y * samples;
            const std::size_t last = count_before(high + a.x - offset);
            for (std::size_t x = count_before(low + a.x - offset); x < last; ++x) {
                const float px = static_cast<float>(static_cast<int>(x)) + offset - a.x;
                const float v = px * v_by.x + py * v_by.y, w = px * w_by.x + py * w_by.y, u = 1 - v - w;
                const float height = u * a.z + v * b.z + w * c.z;
                if (height > row[x].height) row[x] = {height, u * of_a + v * of_b + w * of_c};
            }
        }
    }

    const Camera& camera_;
    std::span<const glm::vec3> positions_;
    std::span<const Unorm16> luminance_;
    Closedness closedness_;
    std::vector<Surface>& surfaces_;
};

// A picture in bands of frequency.
class Bands {
public:
    struct Band {
        Raster light, cover;           // less the means
        Raster mean_light, mean_cover; // over wider areas
    };

    explicit Bands(const Picture& picture) {
        Raster light = picture.light, cover = picture.cover;
        for (Band& band : bands_) {
            band.light = std::move(light), band.cover = std::move(cover);
            light = split(band.light, band.mean_light);
            cover = split(band.cover, band.mean_cover);
        }
    }
    const Band& operator[](std::size_t band) const { return bands_[band]; }

private:
    // Takes the mean away; returns the next level.
    static Raster split(Raster& plane, Raster& mean) {
        Raster next = reduce(plane);
        mean = expand(next, plane.side);
        for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] -= mean.values[i];
        return next;
    }

    std::array<Band, FoldStage::band_count> bands_;
};

// Of a grating's amplitude, in cycles a cell: cells show the mean over their area.
double share_in_cells(double frequency) {
    return std::sin(std::numbers::pi * frequency) / (std::numbers::pi * frequency);
}

using Floats = Float4; // four numbers at a time
constexpr std::size_t width = sizeof(Floats) / sizeof(float);

Floats absolute(Floats v) { return v < 0 ? -v : v; }

// The largest contrasts of a band, of every fourth place on its own.
class BandContrasts {
public:
    explicit BandContrasts(float inverse_gain) : inverse_gain_(inverse_gain) {}

    void include(const Bands::Band& mesh, const Bands::Band& difference) {
        std::size_t count = 0;
        for (std::size_t i = 0; i < difference.light.values.size(); ++i) {
            const float light = difference.light.values[i], cover = difference.cover.values[i];
            if (light == 0 && cover == 0) continue;
            light_[count] = light;
            cover_[count] = cover;
            own_light_[count] = mesh.light.values[i];
            own_cover_[count] = mesh.cover.values[i];
            mean_light_[count] = mesh.mean_light.values[i];
            mean_cover_[count] = mesh.mean_cover.values[i];
            if (++count < width) continue;
            raise();
            count = 0;
        }
        for (std::size_t i = count; i < width; ++i) light_[i] = cover_[i] = 0; // nothing where there are no more places
        raise();
    }

    float largest(std::size_t background, std::size_t row) const {
        float most = 0;
        for (std::size_t i = 0; i < width; ++i) most = std::max(most, most_[background][row][i]);
        return most;
    }

private:
    void raise() {
        constexpr auto& masks = FoldStage::masks;
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k) {
            const float background = FoldStage::backgrounds[k];
            const Floats lit = mean_light_ + background * (1 - mean_cover_), mean = lit < 0 ? Floats{} : lit;
            const Floats to_contrast = inverse_gain_ / (mean + FoldStage::black);
            const Floats mask = absolute(own_light_ - background * own_cover_) * to_contrast;
            const Floats contrast = absolute(light_ - background * cover_) * to_contrast;
            for (std::size_t row = 0; row < masks.size(); ++row) {
                Floats here = contrast;
                if (row > 0) here = mask >= masks[row] ? here : Floats{};
                if (row + 1 < masks.size()) here = mask >= masks[row + 1] ? Floats{} : here;
                Floats& most = most_[k][row];
                most = most < here ? here : most;
            }
        }
    }

    float inverse_gain_;
    Floats light_{}, cover_{}, own_light_{}, own_cover_{}, mean_light_{}, mean_cover_{}; // at four places
    Floats most_[FoldStage::backgrounds.size()][FoldStage::masks.size()] = {};
};

// The contrasts of a difference of pictures.
FoldStage contrasts(const Bands& mesh, const Bands& difference) {
    FoldStage stage;
    for (std::size_t b = 0; b < FoldStage::band_count; ++b) {
        BandContrasts band(1 / static_cast<float>(band_gain(b) * share_in_cells(nominal_frequency(b))));
        band.include(mesh[b], difference[b]);
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
            for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
                stage.contrast[k][b][row] = band.largest(k, row);
    }
    return stage;
}

class StageFinder {
public:
    StageFinder(const SoundTree& tree, std::span<FoldError> errors)
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
        for_each_picture([&](std::size_t i, Picture picture) {
            bands[i].emplace(picture);
            pictures[i] = std::move(picture);
        });
        std::vector<FoldStage> stages(count);
        for (std::size_t stage = 0; stage < count; ++stage) {
            fold(stage);
            std::vector<FoldStage> found(direction_count);
            for_each_picture([&](std::size_t i, Picture picture) {
                picture.subtract(*pictures[i]);
                found[i] = contrasts(*bands[i], Bands(picture));
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
            const float own =
                outline_contrast * e.mean_distance + changed_radius(tree_, errors_, node) * e.wide_luminance;
            light[node] = std::max(light[node], own);
            if (node > 0) light[parents_[node]] = std::max(light[parents_[node]], light[node]);
        }
        std::vector<NodeId> sequence(interior_);
        std::iota(sequence.begin(), sequence.end(), NodeId{0});
        std::sort(sequence.begin(), sequence.end(),
                  [&](NodeId a, NodeId b) { return light[a] != light[b] ? light[a] < light[b] : a > b; });
        double left = first_share * interior_;
        std::uint8_t stage = 0;
        for (NodeId folded = 0; folded < interior_; ++folded) {
            while (left >= fewest_left && interior_ - folded <= left)
                left /= std::exp2(1 / stages_per_halving), ++stage;
            errors_[sequence[folded]].stage = stage;
        }
        return std::size_t{stage} + 1;
    }

    void fold(std::size_t stage) {
        const auto goes_on = [&](NodeId node) {
            return parents_[node] != no_node && errors_[parents_[node]].stage <= stage;
        };
        folded_.resize(interior_);
        for (NodeId node = 0; node < interior_; ++node) folded_[node] = goes_on(node) ? folded_[parents_[node]] : node;
        for (Triangle& t : triangles_)
            for (NodeId& corner : t)
                if (goes_on(corner)) corner = folded_[parents_[corner]];
        std::erase_if(triangles_, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
    }

    template <class F>
    void for_each_picture(F&& f) {
        tbb::parallel_for(std::size_t{0}, direction_count, [&](std::size_t i) {
            f(i, Painter(tree_, cameras_[i], surfaces_.local()).draw(triangles_));
        });
    }

    static void unite(FoldStage& stage, const FoldStage& other) {
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
            for (std::size_t b = 0; b < FoldStage::band_count; ++b)
                for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
                    stage.contrast[k][b][row] = std::max(stage.contrast[k][b][row], other.contrast[k][b][row]);
    }

    const SoundTree& tree_;
    std::span<FoldError> errors_;
    NodeId interior_;
    std::span<const NodeId> parents_;
    std::vector<Triangle> triangles_; // as folded, over nodes
    std::vector<NodeId> folded_;      // by interior node: where it has gone
    std::vector<Camera> cameras_;
    tbb::enumerable_thread_specific<std::vector<Surface>> surfaces_;
};

} // namespace

double FoldStage::frequency(std::size_t band) { return nominal_frequency(band) * side / static_cast<double>(margin); }

std::vector<FoldStage> find_stages(const SoundTree& tree, std::span<FoldError> errors) {
    const float radius = tree.bounding_sphere().radius;
    const bool is_translucent = tree.bounds()[VertexTree::root()].flags & translucent_ring;
    if (is_translucent || !(radius > 0) || !std::isfinite(side / (2 * radius))) return {};
    return StageFinder(tree, errors).run();
}

} // namespace unseen::perception
