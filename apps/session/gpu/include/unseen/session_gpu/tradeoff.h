// What accuracy costs in one view: ways to simplify, the time each takes, and what is seen of it.
#pragma once

#include <unseen/session_gpu/picture_judge.h>

namespace unseen::session {

struct TradeoffOptions {
    double seconds = 45; // wall-clock time for all points, about; the rest is left out. Above 0
    // Samples a pixel of judged pictures, 1 to 256, at most. If drawing is slow, fewer are taken, down to
    // least_samples; V is then larger, because the steps of samples show.
    int samples = 64, least_samples = 8;
    // Measured after the full model, instead of the usual ways: names, and requests for pictures.
    std::vector<std::pair<std::string, Request>> requests = {};
    Progress progress = {}; // returning false stops, with the error `cancelled`
};

// Milliseconds of some frames.
struct Timing {
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    double median = unknown, low = unknown, high = unknown; // half of the frames took `low` to `high`
};

// One way and its results. The judges see as the session's observer does, on the CPU.
struct TradeoffPoint : PictureVerdict { // against the full model
    std::string name;
    Request request;
    bool is_of_view = false; // goes by what this view's picture shows, and holds for no other
    vdtree::Index triangles = 0;
    double make_ms = 0;    // from nothing, errors of folds measured before
    Timing follow_ms = {}; // a frame of an eye that moves around the scene by a tenth of a degree; unknown for stills
    Timing draw_ms = {};   // a frame with one sample a pixel
    double shift = 0;      // see largest_shift()
    bool is_on_front = false; // no other point has fewer triangles and a smaller V
    bool is_recommended = false;
};

struct Tradeoff {
    std::vector<TradeoffPoint> points;      // the full model first
    std::vector<std::string> left_out = {}; // names of points there was no time for
    int samples = 0;                        // of the pictures that were judged
    double measuring_s = 0;                 // of the errors of folds, before all points; next to 0 where they are kept
};

// How far the surfaces of the cuts may be from those of the full models, world units: VertexTree::displacement().
double largest_shift(const Session& session, std::span<const vdtree::Cut> cuts);

// Measures the most informative points first: the full model, the default test at several thresholds, qualities, the
// other tests, budgets. Recommended is the point with the fewest triangles whose fold test is safe, which holds for
// moving views and shows nothing to either judge; if there is none, the full model. Fails as Session::simplify() and
// drawing do; a fold test that does not know the scene is left out. Cost: a simplification and some hundred drawings a
// point.
Result<Tradeoff> measure_tradeoff(Session& session, const render::Context& context, const vdtree::View& view,
                                  const TradeoffOptions& options = {});

} // namespace unseen::session
