#include <session_gpu/as_seen.h>

#include <utility>
#include <vector>

#include <render/depth.h>
#include <render/gpu_tree.h>

namespace unseen::session {
namespace {

Result<std::vector<float>> depths_of(const Session& session, const render::Context& context,
                                     const std::vector<vdtree::Cut>& cuts, const vdtree::View& view, int samples) {
    std::vector<render::Item> items;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        const auto tree = render::GpuTree::create(context, session.tree(i));
        if (!tree) return tree.error();
        render::GpuCut cut(*tree);
        if (auto followed = cut.follow(cuts[i]); !followed) return followed.error();
        items.push_back({std::move(cut), session.scene().objects[i].placement});
    }
    return render::farthest_depth(context, items, view, samples);
}

} // namespace

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, int samples) {
    request.purpose = Purpose::picture;
    request.shown.reset();
    auto all = session.simplify(view, request);
    if (!all) return all;
    const bool can_tell =
        !session.scene().lights && request.goal.kind != Goal::Kind::full && is_perceptual(all->fold_tests.front());
    if (!can_tell) return all;
    const auto depths = depths_of(session, context, all->cuts, view, samples);
    if (!depths) return depths.error();
    auto shown = vdtree::DepthPicture::create(view, *depths);
    if (!shown) return shown.error();
    request.shown = std::move(*shown);
    return session.simplify(view, request);
}

} // namespace unseen::session
