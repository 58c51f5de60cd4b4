#include <unseen/session/internal/selection_search.h>

#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>

#include <unseen/perception/internal/ssim_window.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

// SSIM as perception::ssim() has it.
constexpr int window_size = perception::ssim_window::size; // pixels

std::size_t place_in(int width, int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

// The sum over each window of `value(x, y)` with the window's weights, for the windows whose top left is in `places`.
template <class Value>
void filter(const PixelRect& places, std::vector<double>& columns, std::vector<double>& sums, Value&& value) {
    const auto& window = perception::ssim_window::weights();
    const auto wide = static_cast<std::size_t>(places.width() + window_size - 1);
    const auto out = static_cast<std::size_t>(places.width());
    columns.assign(wide, 0);
    sums.assign(out * static_cast<std::size_t>(places.height()), 0);
    for (int row = 0; row < places.height(); ++row) {
        std::fill(columns.begin(), columns.end(), 0.0);
        for (int k = 0; k < window_size; ++k) {
            const double w = window[static_cast<std::size_t>(k)];
            for (std::size_t i = 0; i < wide; ++i) columns[i] += w * value(i, row + k);
        }
        double* const sum = sums.data() + out * static_cast<std::size_t>(row);
        for (std::size_t k = 0; k < window_size; ++k) {
            const double w = window[k];
            for (std::size_t i = 0; i < out; ++i) sum[i] += w * columns[i + k];
        }
    }
}

} // namespace

std::string name_of(SelectionQuality quality) {
    return quality == SelectionQuality::pixels ? "pixels" : quality == SelectionQuality::contrast ? "contrast" : "ssim";
}

PixelRect united(const PixelRect& a, const PixelRect& b) {
    if (a.is_empty()) return b;
    if (b.is_empty()) return a;
    return {std::min(a.left, b.left), std::min(a.top, b.top), std::max(a.right, b.right), std::max(a.bottom, b.bottom)};
}

// ---- pictures from parts

namespace {

// Puts the rectangle together anew; the rest of `values` stays. `depth`: for the picture's pixels.
void fill(const LayeredPicture& picture, std::span<const int> levels, const PixelRect& box, std::span<float> values,
          std::vector<float>& depth) {
    if (box.is_empty()) return;
    depth.resize(picture.background_depth.size());
    const auto count = static_cast<std::ptrdiff_t>(box.width());
    for (int y = box.top; y < box.bottom; ++y) {
        const auto at = static_cast<std::ptrdiff_t>(place_in(picture.width, box.left, y));
        std::copy_n(picture.background.begin() + at, count, values.begin() + at);
        std::copy_n(picture.background_depth.begin() + at, count, depth.begin() + at);
    }
    for (std::size_t i = 0; i < picture.objects.size(); ++i) {
        const LevelImage& image = picture.objects[i].levels[static_cast<std::size_t>(levels[i])];
        const int left = std::max(box.left, image.box.left), right = std::min(box.right, image.box.right);
        const int top = std::max(box.top, image.box.top), bottom = std::min(box.bottom, image.box.bottom);
        for (int y = top; y < bottom; ++y)
            for (int x = left; x < right; ++x) {
                const std::size_t from = place_in(image.box.width(), x - image.box.left, y - image.box.top),
                                  to = place_in(picture.width, x, y);
                if (image.depth[from] > depth[to]) depth[to] = image.depth[from], values[to] = image.values[from];
            }
    }
}

} // namespace

std::vector<float> put_together(const LayeredPicture& picture, std::span<const int> levels) {
    assert(levels.size() == picture.objects.size());
    std::vector<float> values(picture.background.size()), depth;
    fill(picture, levels, {0, 0, picture.width, picture.height}, values, depth);
    return values;
}

// ---- what a picture loses

Result<PictureLoss> PictureLoss::create(SelectionQuality quality, int width, int height, std::vector<float> reference,
                                        const perception::Display& display) {
    if (width < window_size || height < window_size)
        return invalid_argument("A picture to select levels by has at least 11 x 11 pixels, not " +
                                std::to_string(width) + " x " + std::to_string(height) + ".");
    if (reference.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
        return invalid_argument("A picture of " + std::to_string(width) + " x " + std::to_string(height) +
                                " pixels does not hold " + std::to_string(reference.size()) + " values.");
    for (std::size_t i = 0; i < reference.size(); ++i)
        if (!std::isfinite(reference[i]))
            return invalid_argument("Value " + std::to_string(i) + " of the picture of full detail is not finite.");
    PictureLoss loss;
    loss.quality_ = quality;
    loss.width_ = width, loss.height_ = height;
    const bool is_ssim = quality == SelectionQuality::ssim;
    loss.columns_ = is_ssim ? width - window_size + 1 : width;
    loss.rows_ = is_ssim ? height - window_size + 1 : height;
    loss.losses_.assign(static_cast<std::size_t>(loss.columns_) * static_cast<std::size_t>(loss.rows_), 0);
    if (is_ssim) {
        const PixelRect all{0, 0, loss.columns_, loss.rows_};
        std::vector<double> columns;
        const auto at = [&](std::size_t x, int y) { return static_cast<double>(reference[place_in(width, 0, y) + x]); };
        filter(all, columns, loss.reference_mean_, at);
        filter(all, columns, loss.reference_square_, [&](std::size_t x, int y) { return at(x, y) * at(x, y); });
    } else {
        perception::JudgeOptions judging;
        judging.display = display;
        auto map = perception::threshold_map_modern({width, height, 1, reference}, judging);
        if (!map) return map.error();
        loss.thresholds_ = std::move(map->values);
    }
    loss.reference_ = std::move(reference);
    return loss;
}

PixelRect PictureLoss::places_of(const PixelRect& changed) const {
    if (changed.is_empty()) return {};
    const int before = quality_ == SelectionQuality::ssim ? window_size - 1 : 0;
    return {std::max(changed.left - before, 0), std::max(changed.top - before, 0), std::min(changed.right, columns_),
            std::min(changed.bottom, rows_)};
}

void PictureLoss::count(std::span<const float> picture, const PixelRect& places, std::vector<double>& losses) const {
    losses.resize(static_cast<std::size_t>(places.width()) * static_cast<std::size_t>(places.height()));
    if (quality_ != SelectionQuality::ssim) {
        std::size_t out = 0;
        for (int y = places.top; y < places.bottom; ++y)
            for (int x = places.left; x < places.right; ++x) {
                const std::size_t at = place_in(width_, x, y);
                const double steps = std::abs(static_cast<double>(picture[at]) - static_cast<double>(reference_[at])) /
                                     static_cast<double>(thresholds_[at]);
                const bool is_unseen = steps <= 1; // NaN is seen
                losses[out++] = is_unseen ? 0 : quality_ == SelectionQuality::pixels ? 1 : steps - 1;
            }
        return;
    }
    thread_local std::vector<double> columns, mean, square, product;
    const std::size_t left = static_cast<std::size_t>(places.left);
    const auto test = [&](std::size_t x, int y) {
        return static_cast<double>(picture[place_in(width_, 0, places.top + y) + left + x]);
    };
    const auto reference = [&](std::size_t x, int y) {
        return static_cast<double>(reference_[place_in(width_, 0, places.top + y) + left + x]);
    };
    filter(places, columns, mean, test);
    filter(places, columns, square, [&](std::size_t x, int y) { return test(x, y) * test(x, y); });
    filter(places, columns, product, [&](std::size_t x, int y) { return test(x, y) * reference(x, y); });
    std::size_t out = 0;
    for (int y = places.top; y < places.bottom; ++y)
        for (int x = places.left; x < places.right; ++x, ++out) {
            const std::size_t at = place_in(columns_, x, y);
            losses[out] = 1 - perception::ssim_window::similarity(
                                  {reference_mean_[at], mean[out], reference_square_[at], square[out], product[out]});
        }
}

double PictureLoss::change(std::span<const float> picture, const PixelRect& changed) const {
    const PixelRect places = places_of(changed);
    if (places.is_empty()) return 0;
    thread_local std::vector<double> losses;
    count(picture, places, losses);
    double sum = 0;
    std::size_t from = 0;
    for (int y = places.top; y < places.bottom; ++y)
        for (int x = places.left; x < places.right; ++x) sum += losses[from++] - losses_[place_in(columns_, x, y)];
    return sum;
}

void PictureLoss::take(std::span<const float> picture, const PixelRect& changed) {
    const PixelRect places = places_of(changed);
    if (places.is_empty()) return;
    thread_local std::vector<double> losses;
    count(picture, places, losses);
    std::size_t from = 0;
    for (int y = places.top; y < places.bottom; ++y)
        for (int x = places.left; x < places.right; ++x) {
            double& held = losses_[place_in(columns_, x, y)];
            total_ += losses[from] - held;
            held = losses[from++];
        }
}

// ---- the search

namespace {

// A picture at some levels, with what it loses, and what one change would make of it.
class Search {
public:
    Search(const LayeredPicture& picture, PictureLoss loss, std::vector<float> values)
        : picture_(picture), loss_(std::move(loss)), values_(std::move(values)), tried_(values_),
          levels_(picture.objects.size(), 0) {
        for (const ObjectImages& object : picture.objects) triangles_ += object.triangles.front();
    }

    static Result<Search> begin(const LayeredPicture& picture, SelectionQuality quality,
                                const perception::Display& display) {
        if (auto valid = check(picture); !valid) return valid.error();
        const std::vector<int> full(picture.objects.size(), 0);
        std::vector<float> values = put_together(picture, full);
        auto loss = PictureLoss::create(quality, picture.width, picture.height, values, display);
        if (!loss) return loss.error();
        return Search(picture, std::move(*loss), std::move(values));
    }

    // How much more is lost where the object has this level.
    double change_to(std::size_t i, int level) {
        ++evaluations_;
        const PixelRect changed = try_level(i, level);
        const double change = loss_.change(tried_, changed);
        restore(changed);
        return change;
    }

    // What changed, and all that counts for it.
    PixelRect take(std::size_t i, int level) {
        const PixelRect changed = try_level(i, level);
        loss_.take(tried_, changed);
        for_rows(changed, [&](std::ptrdiff_t at, std::ptrdiff_t count) {
            std::copy_n(tried_.begin() + at, count, values_.begin() + at);
        });
        triangles_ = triangles_ - triangles_of(i, levels_[i]) + triangles_of(i, level);
        levels_[i] = level;
        return changed;
    }

    std::uint64_t triangles_of(std::size_t i, int level) const {
        return picture_.objects[i].triangles[static_cast<std::size_t>(level)];
    }
    int last_level(std::size_t i) const { return static_cast<int>(picture_.objects[i].levels.size()) - 1; }
    // Where a change from one level to the next may show, with the places of the loss that it counts for.
    PixelRect reach(std::size_t i, int level) const {
        const auto& levels = picture_.objects[i].levels;
        return loss_.places_of(
            united(levels[static_cast<std::size_t>(levels_[i])].box, levels[static_cast<std::size_t>(level)].box));
    }
    PixelRect places_of(const PixelRect& changed) const { return loss_.places_of(changed); }

    const std::vector<int>& levels() const { return levels_; }
    std::uint64_t triangles() const { return triangles_; }
    double loss() const { return loss_.total(); }
    std::uint64_t evaluations() const { return evaluations_; }

private:
    static Result<void> check(const LayeredPicture& picture) {
        for (const ObjectImages& object : picture.objects) {
            if (object.levels.empty() || object.levels.size() != object.triangles.size())
                return invalid_argument("Object " + std::to_string(object.object) +
                                        " has not as many images as numbers of triangles.");
            for (const LevelImage& image : object.levels) {
                const PixelRect& box = image.box;
                const auto pixels = box.is_empty() ? 0 : place_in(box.width(), 0, box.height());
                if (!box.is_empty() &&
                    (box.left < 0 || box.top < 0 || box.right > picture.width || box.bottom > picture.height))
                    return invalid_argument("An image of object " + std::to_string(object.object) +
                                            " reaches out of the picture.");
                if (image.values.size() != pixels || image.depth.size() != pixels)
                    return invalid_argument("An image of object " + std::to_string(object.object) +
                                            " has not as many values as pixels.");
            }
        }
        return {};
    }

    template <class Row>
    void for_rows(const PixelRect& box, Row&& row) const {
        for (int y = box.top; y < box.bottom; ++y)
            row(static_cast<std::ptrdiff_t>(place_in(picture_.width, box.left, y)),
                static_cast<std::ptrdiff_t>(box.width()));
    }

    // Into tried_; returns the pixels that look different.
    PixelRect try_level(std::size_t i, int level) {
        const auto& images = picture_.objects[i].levels;
        const PixelRect box =
            united(images[static_cast<std::size_t>(levels_[i])].box, images[static_cast<std::size_t>(level)].box);
        const int before = levels_[i];
        levels_[i] = level;
        fill(picture_, levels_, box, tried_, depth_);
        levels_[i] = before;
        PixelRect changed;
        for (int y = box.top; y < box.bottom; ++y) {
            const std::size_t row = place_in(picture_.width, 0, y);
            const auto differs = [&](int x) {
                const auto at = row + static_cast<std::size_t>(x);
                return !(tried_[at] == values_[at]);
            };
            int left = box.left, right = box.right;
            while (left < right && !differs(left)) ++left;
            while (right > left && !differs(right - 1)) --right;
            if (left < right) changed = united(changed, {left, y, right, y + 1});
        }
        return changed;
    }

    void restore(const PixelRect& changed) {
        for_rows(changed, [&](std::ptrdiff_t at, std::ptrdiff_t count) {
            std::copy_n(values_.begin() + at, count, tried_.begin() + at);
        });
    }

    const LayeredPicture& picture_;
    PictureLoss loss_;
    std::vector<float> values_, tried_; // as it is; the same but for a change that is tried
    std::vector<float> depth_;          // of what is put together
    std::vector<int> levels_;
    std::uint64_t triangles_ = 0, evaluations_ = 0;
};

bool meet(const PixelRect& a, const PixelRect& b) {
    return !a.is_empty() && !b.is_empty() && a.left < b.right && b.left < a.right && a.top < b.bottom &&
           b.top < a.bottom;
}

// One object, one level down.
struct Candidate {
    double cost = 0; // loss a triangle saved
    std::uint64_t saved = 0;
    std::size_t object = 0;
    std::uint64_t version = 0; // of the object's surroundings, when it was counted

    bool operator<(const Candidate& other) const { // the queue's greatest comes first
        return std::tuple(-cost, saved, other.object) < std::tuple(-other.cost, other.saved, object);
    }
};

// Raises by one level what gains most for a triangle and fits, until nothing does.
void spend_the_rest(Search& search, std::uint64_t budget) {
    for (;;) {
        double most = 0;
        std::size_t best = 0;
        bool any = false;
        for (std::size_t i = 0; i < search.levels().size(); ++i) {
            const int level = search.levels()[i];
            if (level == 0) continue;
            const std::uint64_t more = search.triangles_of(i, level - 1) - search.triangles_of(i, level);
            if (search.triangles() + more > budget) continue;
            const double gain = -search.change_to(i, level - 1) / static_cast<double>(std::max<std::uint64_t>(more, 1));
            if (!(gain > most)) continue; // what gains nothing stays
            most = gain, best = i, any = true;
        }
        if (!any) return;
        search.take(best, search.levels()[best] - 1);
    }
}

} // namespace

Result<FoundSelection> select_greedily(const LayeredPicture& picture, SelectionQuality quality,
                                       const perception::Display& display, std::uint64_t budget, bool measures_alone) {
    auto begun = Search::begin(picture, quality, display);
    if (!begun) return begun.error();
    Search& search = *begun;
    const std::size_t objects = picture.objects.size();
    std::vector<std::vector<double>> alone(measures_alone ? objects : 0);
    for (std::size_t i = 0; i < alone.size(); ++i)
        for (int level = 1; level <= search.last_level(i); ++level) alone[i].push_back(search.change_to(i, level));

    std::vector<std::uint64_t> versions(objects, 0);
    std::priority_queue<Candidate> queue;
    const auto add = [&](std::size_t i) {
        const int next = search.levels()[i] + 1;
        if (next > search.last_level(i)) return;
        const std::uint64_t saved = search.triangles_of(i, next - 1) - search.triangles_of(i, next);
        // The first round is what was measured already.
        const double change = measures_alone && search.triangles() > 0 && next == 1 && versions[i] == 0
                                  ? alone[i].front()
                                  : search.change_to(i, next);
        queue.push({change / static_cast<double>(std::max<std::uint64_t>(saved, 1)), saved, i, versions[i]});
    };
    if (search.triangles() > budget)
        for (std::size_t i = 0; i < objects; ++i) add(i);
    while (search.triangles() > budget && !queue.empty()) {
        const Candidate first = queue.top();
        queue.pop();
        if (first.version != versions[first.object]) {
            add(first.object);
            continue;
        }
        const PixelRect changed = search.places_of(search.take(first.object, search.levels()[first.object] + 1));
        // Whoever may share a place with what changed has to be counted anew.
        for (std::size_t i = 0; i < objects; ++i) {
            const int next = std::min(search.levels()[i] + 1, search.last_level(i));
            if (i == first.object || meet(search.reach(i, next), changed)) ++versions[i];
        }
        add(first.object);
    }
    if (search.triangles() <= budget) spend_the_rest(search, budget);
    return FoundSelection{search.levels(),      search.triangles(), search.loss(), search.triangles() <= budget,
                          search.evaluations(), std::move(alone)};
}

} // namespace unseen::session
