#include <session_gpu/as_seen.h>

#include <algorithm>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include <render/depth.h>
#include <render/gpu_tree.h>

namespace unseen::session {
namespace {

// Everything of a scene on the GPU, to be drawn for its depth.
class Items {
public:
    explicit Items(const render::Context& context) : context_(context) {}

    Result<void> add(const vdtree::Cut& cut, const vdtree::VertexTree& tree, const vdtree::Similarity& placement) {
        auto known = trees_.find(&tree.data()); // objects share them
        if (known == trees_.end()) {
            auto made = render::GpuTree::create(context_, tree);
            if (!made) return made.error();
            known = trees_.emplace(&tree.data(), std::move(*made)).first;
        }
        render::GpuCut drawn(known->second);
        if (auto followed = drawn.follow(cut); !followed) return followed;
        items_.push_back({std::move(drawn), placement});
        return {};
    }

    std::span<const render::Item> items() const { return items_; }

private:
    const render::Context& context_;
    std::map<const vdtree::VertexTree::Data*, render::GpuTree> trees_;
    std::vector<render::Item> items_;
};

// The backdrop hides, too, but is hidden from nobody.
Result<std::vector<float>> depths_of(const Session& session, const render::Context& context,
                                     const std::vector<vdtree::Cut>& cuts, const vdtree::View& view, int samples) {
    Items items(context);
    const Scene& scene = session.scene();
    for (std::size_t i = 0; i < cuts.size(); ++i)
        if (auto added = items.add(cuts[i], session.tree(i), scene.objects[i].placement); !added) return added.error();
    for (const Object& part : scene.backdrop) {
        vdtree::Cut whole(part.tree);
        whole.unfold_all();
        if (auto added = items.add(whole, part.tree, part.placement); !added) return added.error();
    }
    return render::farthest_depth(context, items.items(), view, samples);
}

} // namespace

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, int samples) {
    request.purpose = Purpose::picture;
    request.shown.reset();
    auto all = session.simplify(view, request);
    if (!all) return all;
    const bool can_tell = request.goal.kind != Goal::Kind::full && !all->fold_tests.empty() &&
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
