// Keeps cuts at what moving views of a session ask for.
#pragma once

#include <memory>
#include <optional>

#include <unseen/session/request.h>
#include <unseen/session/simplification.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/view.h>

namespace unseen::session {

class Session;

// One cut an object, from frame to frame. For the goals imperceptible and pixels the cost goes with what changes from
// one call to the next; for a budget, with hysteresis 1 or several objects, each call begins anew; full: only the first
// does. Not thread-safe. Move-only.
class Follower {
public:
    explicit Follower(const Session& session); // shares what the session keeps, so the session may go or move
    Follower(Follower&&) noexcept;
    Follower& operator=(Follower&&) noexcept;
    ~Follower();

    // From now on vertices glide for so long where a cut changes, and geomorph() is what to draw. Fails where that is
    // no time, and on trees with textures.
    Result<void> set_glide(double seconds);
    void let_pass(double seconds); // for the glides of the next call; precondition: not negative, finite

    // Makes the cuts what the request asks for. Fails where Session::simplify() does.
    Result<Report> follow(const vdtree::View& view, const Request& request);

    // As of the last call of follow(), from which on there is a cut.
    const vdtree::Cut& cut(std::size_t object = 0) const;
    const vdtree::Geomorph* geomorph(std::size_t object = 0) const; // null: nothing glides

private:
    friend class Session;
    class State;
    std::unique_ptr<State> state_;
};

} // namespace unseen::session
