// Keeps the cuts of a session up to date while the view moves.
#pragma once

#include <unseen/session/simplification.h>
#include <unseen/vdtree/geomorph.h>

namespace unseen::session {

class Session;

// One cut for each object, from frame to frame. With the goals imperceptible and pixels, a call costs what changes
// since the last one. With a budget and either hysteresis 1 or several objects, each call starts from scratch. With the
// full model only the first one does. Not thread-safe. Move-only.
class Follower {
public:
    explicit Follower(const Session& session); // shares the session, which may be moved or destroyed
    Follower(Follower&&) noexcept = default;
    Follower& operator=(Follower&&) noexcept = default;

    // From now on, vertices glide for this time when a cut changes; draw geomorph() instead of cut(). Fails if the time
    // is not above 0 and finite, and on trees with textures.
    Result<void> set_glide(double seconds);
    void let_pass(double seconds); // advances the glides in the next call; precondition: not negative, finite

    // Updates the cuts for a view. Fails where Session::simplify() does.
    Result<Report> follow(const vdtree::View& view, const Request& request);

    // After the last call of follow(). Precondition: there was one.
    const vdtree::Cut& cut(std::size_t object = 0) const;
    const vdtree::Geomorph* geomorph(std::size_t object = 0) const; // null without set_glide()

private:
    friend class Session;
    class State;
    std::shared_ptr<State> state_;
};

} // namespace unseen::session
