// How a request is met: by which fold test, and what takes part.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <unseen/session/request.h>

namespace unseen::session {

// Something that may or may not take part in a cut, and the reason in a sentence.
struct Effect {
    std::string name;
    bool on = false;
    Message why = {};
    std::size_t object = 0; // of the scene
};

// Of one object. The default fold test is `error`, where the tree has the errors of its folds or they may be measured;
// else, or where that does not know what there is to see (colours that count, textures over vertices of several hues, lights that move or make highlights), the
// Luebke-Hallen test that does. For a goal in pixels it is `extent`.
struct Plan {
    FoldTest fold_test = FoldTest::error;
    std::string why = {};  // this test and not `error`; empty where it is, or was asked for
    bool measures = false; // the errors of the tree's folds have yet to be measured
    std::vector<Effect> effects = {};
};

} // namespace unseen::session
