#include <session_gpu/as_seen.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include <render/depth.h>
#include <render/gpu_tree.h>

namespace unseen::session {
namespace {

Result<std::vector<float>> depths_of(const Session& session, const render::Context& context,
                                     const std::vector<vdtree::Cut>& cuts, const vdtree::View& view, int samples) {
    std::vector<render::Item> items;
    std::map<const vdtree::VertexTree::Data*, render::GpuTree> trees; // objects share them
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        auto tree = trees.find(&session.tree(i).data());
        if (tree == trees.end()) {
            auto made = render::GpuTree::create(context, session.tree(i));
            if (!made) return made.error();
            tree = trees.emplace(&session.tree(i).data(), std::move(*made)).first;
        }
        render::GpuCut cut(tree->second);
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
    const bool casts = session.scene().lights && !session.scene().lights->casting().empty(); // what is hidden may, too
    const bool can_tell = !casts && request.goal.kind != Goal::Kind::full && !all->fold_tests.empty() &&
                          is_perceptual(all->fold_tests.front()) &&
                          (!session.scene().lights ||
                           std::ranges::all_of(all->fold_tests, [](FoldTest test) { return test == FoldTest::error; }));
    if (!can_tell) return all;
    const auto depths = depths_of(session, context, all->cuts, view, samples);
    if (!depths) return depths.error();
    auto shown = vdtree::DepthPicture::create(view, *depths);
    if (!shown) return shown.error();
    request.shown = std::move(*shown);
    return session.simplify(view, request);
}

} // namespace unseen::session
