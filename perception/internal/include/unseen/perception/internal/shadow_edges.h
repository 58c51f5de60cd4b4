// How far a shadow's edge may move without anybody seeing it: what cuts may do to outlines as lights see them.
//
// Where an outline moves by d across the light, the edge of its shadow moves by d / cos theta on a surface that the
// light meets under the angle theta from its normal, and the strip between loses or gains E cos theta of light. So a
// strip is wide where its contrast is low. What it is seen against is the ambient light, at least, and its own half.
// The strip itself is taken for an outline that moves one way, see FoldModel.
#pragma once

#include <unseen/perception/criterion.h>

namespace unseen::perception {

class ShadowEdges {
public:
    // `ambient`: relative luminance of white where no light comes; 0 where anything may be as dark. Of the options the
    // scene does not count. The gaze may be anywhere. Fails as the fold tests do. Cost: some milliseconds.
    static Result<ShadowEdges> create(const vdtree::View& view, const FoldTestOptions& options, double ambient);

    // How far an outline may move across the light, for each unit that the eye is away from the shadow. Not growing
    // with the illuminance, which is the relative luminance of white that faces the light there.
    double widest_unseen(double illuminance) const;

private:
    explicit ShadowEdges(std::vector<double> widest) : widest_(std::move(widest)) {}
    std::vector<double> widest_; // times the illuminance, by its class
};

} // namespace unseen::perception
