#include "measure/fold_picture.h"

#include <algorithm>

#include <glm/geometric.hpp>

#include "measure/pyramid.h"
#include "measure/registers.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr float nothing = -std::numeric_limits<float>::infinity(); // seen in a cell
constexpr std::size_t side = FoldPicture::side, bands = FoldPicture::bands;
constexpr float least_seen = 0.05f; // of the cells around, for a mean over them to say anything

// ---- drawing

// A triangle as a picture shows it.
template <std::size_t count>
struct Shown {
    float x, y, height;         // of a corner: cells, mesh units
    float vx, vy, wx, wy;       // by how much the shares of the other two grow from cell to cell
    float height_v, height_w;   // their heights less the corner's
    std::size_t x0, x1, y0, y1; // cells whose middles may lie between the corners
    // Relative: the corner's, and the others' less the corner's.
    std::array<float, count> luminance, luminance_v, luminance_w;
};

// A layer's cells.
template <std::size_t count>
struct Canvas {
    float* height;
    std::array<float*, count> luminance;
};

// Cells of a row are looked at by registers, `Floats`, whether they lie in the triangle or not.
template <class Floats, std::size_t count>
UNSEEN_INLINE void draw_rows(const Shown<count>& t, const Canvas<count>& on) {
    constexpr std::size_t width = width_of<Floats>;
    static_assert(side % width == 0);
    Floats lane;
    for (std::size_t i = 0; i < width; ++i) lane[i] = static_cast<float>(i);
    const auto from = static_cast<float>(t.x0), to = static_cast<float>(t.x1);
    for (std::size_t y = t.y0; y < t.y1; ++y) {
        const float dy = static_cast<float>(y) + 0.5f - t.y;
        const float v_here = dy * t.vy, w_here = dy * t.wy;
        for (std::size_t begin = t.x0 / width * width; begin < t.x1; begin += width) {
            const std::size_t cell = y * side + begin;
            float* const height = on.height + cell;
            const Floats x = lane + static_cast<float>(begin), dx = x + 0.5f - t.x;
            const Floats v = dx * t.vx + v_here, w = dx * t.wx + w_here;
            const Floats h = t.height + v * t.height_v + w * t.height_w;
            const Floats old_height = floats_at<Floats>(height);
            const auto is_seen = (x >= from) & (x < to) & (v >= 0) & (w >= 0) & (v + w <= 1) & (h > old_height);
            store<Floats>(is_seen ? h : old_height, height);
            for (std::size_t i = 0; i < count; ++i) {
                float* const luminance = on.luminance[i] + cell;
                const Floats l = t.luminance[i] + v * t.luminance_v[i] + w * t.luminance_w[i];
                store<Floats>(is_seen ? l : floats_at<Floats>(luminance), luminance);
            }
        }
    }
}
// ---- bands of frequency

// The kernel of the pyramid, of which no cell is left out; by distance in steps.
constexpr std::array<float, 3> kernel = {static_cast<float>(kernel_middle), static_cast<float>(kernel_near),
                                         static_cast<float>(kernel_far)};
constexpr std::size_t longest_step = std::size_t{1} << (bands - 1), margin = (kernel.size() - 1) * longest_step;

// Cells with zeros around them, as far as the longest kernel reaches. Nothing writes on the zeros.
struct Framed {
    static constexpr std::size_t pitch = side + 2 * margin;
    alignas(64) float cells[pitch * pitch] = {};

    float* row(std::size_t y) { return cells + (y + margin) * pitch + margin; }
};

// What smoothing works on: made once a thread, for the zeros.
struct Worktop {
    Framed difference, seen, mean_seen, smooth, half_smooth;
};
thread_local Worktop worktop;

// Calls f(y, x) for the first cell of each register.
template <class Floats, class F>
UNSEEN_INLINE void for_each_register(F&& f) {
    static_assert(side % width_of<Floats> == 0);
    for (std::size_t y = 0; y < side; ++y)
        for (std::size_t x = 0; x < side; x += width_of<Floats>) f(y, x);
}

template <class Floats>
UNSEEN_INLINE Floats smooth_along(const float* at, std::size_t step) {
    const auto both = [&](std::size_t steps) UNSEEN_INLINE_LAMBDA {
        return floats_at<Floats>(at - steps * step) + floats_at<Floats>(at + steps * step);
    };
    return kernel[0] * floats_at<Floats>(at) + kernel[1] * both(1) + kernel[2] * both(2);
}

template <class Floats>
UNSEEN_INLINE void smooth(Framed& in, std::size_t step, Framed& half_smooth, Framed& out) {
    for_each_register<Floats>([&](std::size_t y, std::size_t x) UNSEEN_INLINE_LAMBDA {
        store(smooth_along<Floats>(in.row(y) + x, step), half_smooth.row(y) + x);
    });
    for_each_register<Floats>([&](std::size_t y, std::size_t x) UNSEEN_INLINE_LAMBDA {
        store(smooth_along<Floats>(half_smooth.row(y) + x, step * Framed::pitch), out.row(y) + x);
    });
}

template <class Floats>
UNSEEN_INLINE Floats magnitude(const Floats& v) {
    return v < 0 ? -v : v;
}
template <class Floats>
UNSEEN_INLINE float largest_of(const Floats& values) {
    float most = 0;
    for (std::size_t i = 0; i < width_of<Floats>; ++i) most = std::max(most, values[i]);
    return most;
}

// The largest absolute value of the difference in the mean over some cells, of which most are seen.
template <class Floats>
UNSEEN_INLINE float find_largest_mean(Worktop& on) {
    smooth<Floats>(on.difference, 1, on.half_smooth, on.smooth);
    smooth<Floats>(on.seen, 1, on.half_smooth, on.mean_seen);
    Floats most{};
    for_each_register<Floats>([&](std::size_t y, std::size_t x) UNSEEN_INLINE_LAMBDA {
        const Floats seen = floats_at<Floats>(on.mean_seen.row(y) + x),
                     mean = magnitude(floats_at<Floats>(on.smooth.row(y) + x) / seen);
        most = ((seen > 0.5f) & (most < mean)) ? mean : most;
    });
    return largest_of(most);
}

// The largest absolute values of the difference in each band, times the weights of its cells; null: 1.
template <class Floats>
UNSEEN_INLINE void split(Worktop& on, const float* weights, float* largest) {
    Framed *low = &on.difference, *lower = &on.seen; // take turns
    for (std::size_t band = 0; band < bands; ++band, std::swap(low, lower)) {
        const std::size_t step = std::size_t{1} << band;
        smooth<Floats>(*low, step, on.half_smooth, *lower);
        smooth<Floats>(*lower, step, on.half_smooth, on.smooth);
        Floats most{};
        for_each_register<Floats>([&](std::size_t y, std::size_t x) UNSEEN_INLINE_LAMBDA {
            Floats amplitude = magnitude(floats_at<Floats>(low->row(y) + x) - floats_at<Floats>(on.smooth.row(y) + x));
            if (weights) amplitude *= floats_at<Floats>(weights + (band * side + y) * side + x);
            most = most < amplitude ? amplitude : most;
        });
        largest[band] = largest_of(most);
    }
}

// Cells of both surfaces.
template <std::size_t count>
struct Compared {
    const float *mesh_height, *folded_height;
    std::array<const float*, count> mesh_luminance, folded_luminance;
    std::size_t compared; // of the luminances
    const float* weights; // by band and cell; null: 1
};

// Puts by how much one differs from the other where both are seen on the worktop.
template <class Floats, std::size_t count>
UNSEEN_INLINE void subtract(const Compared<count>& c, const float* folded, const float* mesh, Worktop& on) {
    for_each_register<Floats>([&](std::size_t y, std::size_t x) UNSEEN_INLINE_LAMBDA {
        const std::size_t cell = y * side + x;
        const auto are_seen =
            (floats_at<Floats>(c.folded_height + cell) > nothing) & (floats_at<Floats>(c.mesh_height + cell) > nothing);
        const Floats by = floats_at<Floats>(folded + cell) - floats_at<Floats>(mesh + cell);
        store<Floats>(are_seen ? by : Floats{}, on.difference.row(y) + x);
        store<Floats>(are_seen ? Floats{} + 1 : Floats{}, on.seen.row(y) + x);
    });
}

template <class Floats, std::size_t count>
UNSEEN_INLINE void compare_cells(const Compared<count>& c, typename FoldPictureOf<count>::Difference& difference) {
    Worktop& on = worktop;
    subtract<Floats>(c, c.folded_height, c.mesh_height, on);
    difference.shift = find_largest_mean<Floats>(on);
    for (std::size_t i = 0; i < c.compared; ++i) {
        subtract<Floats>(c, c.folded_luminance[i], c.mesh_luminance[i], on);
        split<Floats>(on, c.weights, difference.amplitudes[i].data());
    }
}
using vdtree::Float4;
using vdtree::Int4;

// The first register of a point, or of a place.
template <class T>
Float4 load(const T& point) {
    static_assert(sizeof(T) % sizeof(Float4) == 0);
    Float4 to;
    std::memcpy(&to, &point, sizeof to);
    return to;
}
Float4 least(const Float4& a, const Float4& b) { return a < b ? a : b; }
Float4 largest(const Float4& a, const Float4& b) { return a < b ? b : a; }

// The first cell whose middle lies at these places or beyond.
Int4 first_cell(const Float4& place) {
    constexpr auto most = static_cast<float>(side);
    const Float4 cell = least(largest(place - 0.5f, Float4{}), Float4{most, most, most, most});
    const Int4 whole = __builtin_convertvector(cell, Int4);
    return whole - (__builtin_convertvector(whole, Float4) < cell); // true is -1
}

} // namespace

template <std::size_t count>
void FoldPictureOf<count>::look(glm::vec3 centre, glm::vec3 normal, float half_width) {
    centre_ = centre;
    const glm::vec3 axis = std::abs(normal.x) < 0.6f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
    const glm::vec3 right = glm::normalize(glm::cross(axis, normal));
    axes_ = {right, glm::cross(normal, right), normal};
    cell_ = 2 * half_width / static_cast<float>(side);
    has_front_ = has_back_ = false;
    for (const Layer layer : {Layer::mesh, Layer::folded}) clear(layer);
}

template <std::size_t count>
void FoldPictureOf<count>::clear(Layer layer) {
    pictures_[static_cast<std::size_t>(layer)].height.fill(nothing);
}

template <std::size_t count>
typename FoldPictureOf<count>::Place FoldPictureOf<count>::place(const LitPoint& point) const {
    const Float4 p = load(point);
    const auto from = [&](int axis) { return p[axis] - centre_[axis]; };
    const auto along = [&](int axis) { return Float4{axes_[0][axis], axes_[1][axis], axes_[2][axis], 0}; };
    Float4 to = from(0) * along(0) + from(1) * along(1) + from(2) * along(2);
    to[3] = p[3];
    Place place;
    std::memcpy(&place, &to, sizeof to);
    for (std::size_t i = 1; i < std::size(place.luminance); ++i) place.luminance[i] = point.luminance[i];
    return place;
}

template <std::size_t count>
void FoldPictureOf<count>::draw(Layer layer, const Place& a, const Place& b, const Place& c) {
    constexpr float half = static_cast<float>(side) / 2;
    const Float4 size = {cell_, cell_, 1, 1}, middle = {half, half, 0, 0};
    const Float4 p = load(a) / size + middle, q = load(b) / size + middle, r = load(c) / size + middle;
    const Float4 pq = q - p, pr = r - p;
    const float area = pq[0] * pr[1] - pq[1] * pr[0];
    if (!(std::abs(area) > 0)) return;
    (area > 0 ? has_front_ : has_back_) = true;
    const Int4 first = first_cell(least(p, least(q, r))), end = first_cell(largest(p, largest(q, r)));
    if (first[0] == end[0] || first[1] == end[1]) return; // many of what is far below the node
    const float inverse = 1 / area;
    Shown<count> t = {.x = p[0],
                      .y = p[1],
                      .height = p[2],
                      .vx = pr[1] * inverse,
                      .vy = -pr[0] * inverse,
                      .wx = -pq[1] * inverse,
                      .wy = pq[0] * inverse,
                      .height_v = pq[2],
                      .height_w = pr[2],
                      .x0 = static_cast<std::size_t>(first[0]),
                      .x1 = static_cast<std::size_t>(end[0]),
                      .y0 = static_cast<std::size_t>(first[1]),
                      .y1 = static_cast<std::size_t>(end[1]),
                      .luminance = {},
                      .luminance_v = {},
                      .luminance_w = {}};
    for (std::size_t i = 0; i < count; ++i) {
        t.luminance[i] = a.luminance[i];
        t.luminance_v[i] = b.luminance[i] - a.luminance[i], t.luminance_w[i] = c.luminance[i] - a.luminance[i];
    }
    Picture& picture = pictures_[static_cast<std::size_t>(layer)];
    Canvas<count> on{picture.height.data(), {}};
    for (std::size_t i = 0; i < count; ++i) on.luminance[i] = picture.luminance[i].data();
    on_widest([&]<class Floats>() UNSEEN_INLINE_LAMBDA { draw_rows<Floats>(t, on); });
}

template <std::size_t count>
float FoldPictureOf<count>::wavelength(std::size_t band) const {
    return cell_ / static_cast<float>(nominal_frequency(band));
}

template <std::size_t count>
typename FoldPictureOf<count>::Difference FoldPictureOf<count>::difference(std::size_t compared_count,
                                                                           const BandCells* weights) const {
    static const std::array<float, bands> gains = [] {
        std::array<float, bands> all;
        for (std::size_t band = 0; band < bands; ++band) all[band] = static_cast<float>(band_gain(band));
        return all;
    }();
    const auto& [mesh, folded] = pictures_;
    Difference difference{};
    Compared<count> compared{
        mesh.height.data(), folded.height.data(), {}, {}, compared_count, weights ? weights->front().data() : nullptr};
    for (std::size_t i = 0; i < count; ++i) {
        compared.mesh_luminance[i] = mesh.luminance[i].data();
        compared.folded_luminance[i] = folded.luminance[i].data();
    }
    on_widest([&]<class Floats>() UNSEEN_INLINE_LAMBDA { compare_cells<Floats>(compared, difference); });
    for (auto& of_luminance : difference.amplitudes)
        for (std::size_t band = 0; band < bands; ++band) of_luminance[band] /= gains[band];
    return difference;
}

template <std::size_t count>
void FoldPictureOf<count>::find_means(Layer layer, const Cells& values, BandCells& means) const {
    const Cells& height = pictures_[static_cast<std::size_t>(layer)].height;
    Worktop& on = worktop;
    for (std::size_t cell = 0; cell < height.size(); ++cell) {
        const bool seen = is_seen(height[cell]);
        on.difference.row(cell / side)[cell % side] = seen ? values[cell] : 0.0f;
        on.seen.row(cell / side)[cell % side] = seen ? 1.0f : 0.0f;
    }
    for (std::size_t band = 0; band < bands; ++band) {
        const std::size_t step = std::size_t{1} << band;
        for (Framed* const plane : {&on.difference, &on.seen}) // the next band's
            smooth<vdtree::Float4>(*plane, step, on.half_smooth, *plane);
        smooth<vdtree::Float4>(on.difference, step, on.half_smooth, on.smooth);
        smooth<vdtree::Float4>(on.seen, step, on.half_smooth, on.mean_seen);
        for (std::size_t cell = 0; cell < height.size(); ++cell) {
            const float share = on.mean_seen.row(cell / side)[cell % side];
            means[band][cell] = share > least_seen ? on.smooth.row(cell / side)[cell % side] / share : -1.0f;
        }
    }
}

template <std::size_t count>
float FoldPictureOf<count>::largest_mean(const Cells& values) const {
    const auto& [mesh, folded] = pictures_;
    Worktop& on = worktop;
    for (std::size_t cell = 0; cell < values.size(); ++cell) {
        const bool seen = is_seen(mesh.height[cell]) && is_seen(folded.height[cell]);
        on.difference.row(cell / side)[cell % side] = seen ? values[cell] : 0.0f;
        on.seen.row(cell / side)[cell % side] = seen ? 1.0f : 0.0f;
    }
    return find_largest_mean<vdtree::Float4>(on);
}

template class FoldPictureOf<1>;
template class FoldPictureOf<3>;
template class FoldPictureOf<4>;
template class FoldPictureOf<5>;
template class FoldPictureOf<6>;

} // namespace unseen::perception
