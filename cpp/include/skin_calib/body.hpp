// Several links, or two feet: poses in; wrench, ZMP and supporting polygon of all of them out. See runtime/body.py.
#pragma once

#include <memory>

#include "skin.hpp"

namespace skin_calib {

// Return a wrench about the origin of another frame, along its axes, with the pose of the link in that frame.
inline Vec6 carried(const Vec6& w, const Pose& pose) noexcept {
    const auto turned = [&pose](const Vec3& v) {
        const auto row = [&](std::size_t k) { return pose[k][0] * v[0] + pose[k][1] * v[1] + pose[k][2] * v[2]; };
        return Vec3{row(0), row(1), row(2)};
    };
    const Vec3 force = turned({w[0], w[1], w[2]}), arm{pose[0][3], pose[1][3], pose[2][3]};
    const Vec3 moment = plus(turned({w[3], w[4], w[5]}), cross(arm, force));
    return {force[0], force[1], force[2], moment[0], moment[1], moment[2]};
}

// What one link of a body gets in a cycle. Without readings or pose its contact is not known.
struct LinkInput {
    const double* readings = nullptr;
    std::size_t count = 0;
    const Pose* pose = nullptr; // T_world_link
};

// The state of several skins at one time, in the world frame; points on the ground have its coordinates.
struct BodyFrame {
    double time = 0;                   // [s]
    Flags flags = 0;                   // of the body: not_coplanar
    std::vector<Flags> link_flags;     // (links,) of each link: those of its frame, no_reading, no_pose, wrong_pose
    std::vector<const Frame*> links;   // (links,) its frame; nullptr without reading or pose
    Booleans lost;                     // (links,) whether the contact of the link is not known
    bool is_foot_lost = false;         // whether such a link may stand: then no point and no polygon is known
    Booleans standing;                 // (links,) whether the link carries enough load for a CoP
    std::optional<Vec6> wrench;        // of all links about the origin of the world [N, N m]; nothing if one is lost
    Reason reason = Reason::not_known; // why there is no ZMP
    std::optional<Vec2> cop, zmp, cop_sigma, zmp_sigma; // on the ground [m]
    SupportingPolygon polygon; // of the standing feet, on the ground; nothing is in it if a foot is lost
    Trusted trusted;           // of all links together; its point and polygon are those of the links with a ground
};

// The skins of several links of one robot. `update` allocates no memory, takes no locks and throws nothing.
class Body {
public:
    std::vector<std::unique_ptr<Skin>> skins; // the order of links in inputs and frames
    Plane ground;                             // in the world frame

    // Add a skin before `start`, and return it: call its `start`.
    Skin& add() { return *skins.emplace_back(std::make_unique<Skin>()); }

    // Allocate everything, after all skins were started.
    void start(const Plane& world_ground = {}) {
        ground = world_ground;
        frame_ = BodyFrame{};
        frame_.link_flags.assign(skins.size(), 0);
        frame_.links.assign(skins.size(), nullptr);
        frame_.lost.assign(skins.size(), 0);
        frame_.standing.assign(skins.size(), 0);
        poses_.assign(skins.size(), Pose{});
        std::size_t most = 0;
        for (const auto& skin : skins) {
            if (!skin->ground) continue;
            most += std::max(skin->ground->corner_hull.hull.corners.capacity(),
                             skin->ground->erosion.result.corners.capacity());
        }
        points_.reserve(most), hull_.reserve(most);
        SupportingPolygon& polygon = frame_.polygon;
        for (Polygon* p : {&polygon.outer, &polygon.nominal, &polygon.guaranteed}) p->corners.reserve(most + 1);
    }

    // Return the frame of all links in one cycle; it is valid until the next call.
    //   inputs: (links,) readings and pose of each link; `time`: of the readings [s]
    const BodyFrame& update(const LinkInput* inputs, double time) noexcept {
        frame_.time = time, frame_.is_foot_lost = false;
        bool is_any_lost = false;
        for (std::size_t k = 0; k < skins.size(); ++k) {
            update_link(k, inputs ? inputs[k] : LinkInput{}, time);
            is_any_lost = is_any_lost || frame_.lost[k];
            frame_.is_foot_lost = frame_.is_foot_lost || (frame_.lost[k] && skins[k]->ground);
            frame_.standing[k] = frame_.links[k] && frame_.links[k]->stands();
        }
        frame_.flags = is_coplanar() ? 0u : flag::not_coplanar;
        frame_.wrench = is_any_lost ? std::nullopt : std::optional<Vec6>(total(false));
        find_reason();
        frame_.cop = frame_.zmp = frame_.cop_sigma = frame_.zmp_sigma = std::nullopt;
        if (frame_.reason == Reason::none) find_points();
        find_polygon();
        find_trusted(is_any_lost);
        return frame_;
    }

private:
    // Update one link, and find out whether its contact is known.
    void update_link(std::size_t k, const LinkInput& input, double time) noexcept {
        frame_.links[k] = nullptr;
        if (!input.readings) {
            frame_.link_flags[k] = flag::no_reading, frame_.lost[k] = 1;
            return;
        }
        const Frame& frame = skins[k]->update(input.readings, input.count, time);
        const Flags problem = input.pose ? check(*input.pose) : flag::no_pose;
        const std::optional<bool> touched = frame.touched();
        frame_.link_flags[k] = frame.flags | problem;
        frame_.lost[k] = !frame.is_known || frame.is_lost || (problem != 0 && touched.value_or(false));
        if (problem != 0) return;
        frame_.links[k] = &frame;
        poses_[k] = *input.pose;
    }

    // Return the flag of a pose that has numbers that are not finite, or scales, mirrors, shears or projects; or 0.
    static Flags check(const Pose& pose) noexcept {
        constexpr double max_rotation_error = 1e-4;
        const auto axis = [&pose](std::size_t k) { return Vec3{pose[k][0], pose[k][1], pose[k][2]}; };
        for (const auto& row : pose)
            if (!all_finite(row)) return flag::no_pose;
        double error = 0;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j) error = std::max(error, std::abs(dot(axis(i), axis(j)) - (i == j)));
        for (std::size_t j = 0; j < 4; ++j) error = std::max(error, std::abs(pose[3][j] - (j == 3)));
        return error <= max_rotation_error && dot(cross(axis(0), axis(1)), axis(2)) > 0 ? 0u : flag::wrong_pose;
    }

    static Vec3 turned(const Pose& pose, const Vec3& v) noexcept {
        const Vec6 w = carried({v[0], v[1], v[2], 0, 0, 0}, pose);
        return {w[0], w[1], w[2]};
    }

    // Return a point of the ground of a foot in the world [m].
    Vec3 in_world(std::size_t k, const Vec3& point) const noexcept {
        return plus(turned(poses_[k], point), {poses_[k][0][3], poses_[k][1][3], poses_[k][2][3]});
    }

    // Return a point (2,) on the ground of a foot, projected on the common ground.
    Vec2 on_ground(std::size_t k, const Vec2& point) const noexcept {
        return ground.flat(in_world(k, skins[k]->ground->plane.spatial(point)));
    }

    // Return whether all standing feet are at one height and parallel to the ground.
    bool is_coplanar() const noexcept {
        constexpr double max_height_difference = 0.005; // [m]
        const double min_cosine = std::cos(3.0 * 3.14159265358979323846 / 180);
        double low = infinity, high = -infinity;
        for (std::size_t k = 0; k < skins.size(); ++k) {
            if (!frame_.standing[k]) continue;
            const Plane& sole = skins[k]->ground->plane;
            const double height = ground.height(in_world(k, sole.origin));
            low = std::min(low, height), high = std::max(high, height);
            if (dot(turned(poses_[k], sole.axes[2]), ground.axes[2]) < min_cosine) return false;
        }
        return !(high - low > max_height_difference);
    }

    // Return the sum of the wrenches of all links, or of the standing ones, about the origin of the world.
    Vec6 total(bool only_standing) const noexcept {
        Vec6 sum{};
        for (std::size_t k = 0; k < skins.size(); ++k) {
            if (!frame_.links[k] || (only_standing && !frame_.standing[k])) continue;
            const Vec6 w = carried(frame_.links[k]->wrench, poses_[k]);
            for (std::size_t i = 0; i < 6; ++i) sum[i] += w[i];
        }
        return sum;
    }

    void find_reason() noexcept {
        if (frame_.is_foot_lost) {
            frame_.reason = Reason::not_known;
            return;
        }
        bool any = false, all_free = true, has_foot = false;
        for (std::size_t k = 0; k < skins.size(); ++k) {
            any = any || frame_.standing[k];
            if (!frame_.links[k] || !skins[k]->ground) continue;
            has_foot = true;
            all_free = all_free && frame_.links[k]->sets.stands == std::optional<bool>(false);
        }
        frame_.reason = any ? Reason::none : has_foot && all_free ? Reason::no_load : Reason::low_load;
    }

    // Find which statements hold of all links together.
    void find_trusted(bool is_any_lost) noexcept {
        const bool is_known = !frame_.is_foot_lost;
        frame_.trusted = {!is_any_lost, !is_any_lost, is_known, is_known && frame_.flags == 0, frame_.flags};
        for (std::size_t k = 0; k < skins.size(); ++k) {
            if (!frame_.links[k]) continue;
            const Trusted own = frame_.links[k]->trusted();
            frame_.trusted.touched = frame_.trusted.touched && own.touched;
            frame_.trusted.wrench = frame_.trusted.wrench && own.wrench;
            frame_.trusted.why |= own.why;
            if (!skins[k]->ground) continue;
            frame_.trusted.point = frame_.trusted.point && own.point;
            frame_.trusted.guaranteed = frame_.trusted.guaranteed && own.guaranteed;
        }
    }

    // Compute CoP, ZMP and their standard deviations from those of the standing feet.
    void find_points() noexcept {
        const Vec6 w = ground.wrench(total(true));
        if (w[2] > 0) {
            const Vec2 zmp{-w[4] / w[2], w[3] / w[2]};
            if (all_finite(zmp)) frame_.zmp = zmp;
        }
        double load = 0;
        Vec2 cop{};
        for (std::size_t k = 0; k < skins.size(); ++k) {
            if (!frame_.standing[k]) continue;
            const Vec2 own = on_ground(k, *frame_.links[k]->cop);
            load += frame_.links[k]->load;
            for (std::size_t i = 0; i < 2; ++i) cop[i] += frame_.links[k]->load * own[i];
        }
        frame_.cop = Vec2{cop[0] / load, cop[1] / load};
        frame_.cop_sigma = deviation(frame_.cop, load, &Frame::cop, &Frame::cop_sigma);
        frame_.zmp_sigma = deviation(frame_.zmp, load, &Frame::zmp, &Frame::zmp_sigma);
    }

    // Return the standard deviations of the mean of points of the feet, weighted by their loads.
    std::optional<Vec2> deviation(const std::optional<Vec2>& point, double total, std::optional<Vec2> Frame::* own,
                                  std::optional<Vec2> Frame::* sigma) const noexcept {
        if (!point) return std::nullopt;
        Vec2 variance{};
        for (std::size_t k = 0; k < skins.size(); ++k) {
            if (!frame_.standing[k]) continue;
            const Frame& foot = *frame_.links[k];
            if (!(foot.*own) || !(foot.*sigma) || !foot.load_sigma) return std::nullopt;
            const Vec2 at = on_ground(k, *(foot.*own));
            for (std::size_t i = 0; i < 2; ++i) {
                double square = 0;
                for (std::size_t j = 0; j < 2; ++j) {
                    const double axis = dot(ground.axes[i], turned(poses_[k], skins[k]->ground->plane.axes[j]));
                    square += axis * axis * (*(foot.*sigma))[j] * (*(foot.*sigma))[j];
                }
                const double fraction = foot.load / total, apart = (at[i] - (*point)[i]) * *foot.load_sigma / total;
                variance[i] += square * fraction * fraction + apart * apart;
            }
        }
        for (std::size_t k = 0; k < skins.size(); ++k) { // a foot that does not stand may carry what its noise hides
            const Frame* foot = frame_.links[k];
            if (!foot || !skins[k]->ground || frame_.standing[k] || foot->load_sigma.value_or(0) == 0) continue;
            const Vec2 at = on_ground(k, skins[k]->ground->middle);
            for (std::size_t i = 0; i < 2; ++i) {
                const double apart = (at[i] - (*point)[i]) * *foot->load_sigma / total;
                variance[i] += apart * apart;
            }
        }
        return Vec2{std::sqrt(variance[0]), std::sqrt(variance[1])};
    }

    // Compute the hulls of the polygons of the standing feet, and the probabilities that all feet are right.
    void find_polygon() noexcept {
        SupportingPolygon& polygon = frame_.polygon;
        join(&SupportingPolygon::outer, &SupportingPolygon::outer_probability);
        join(&SupportingPolygon::nominal, nullptr);
        join(&SupportingPolygon::guaranteed, &SupportingPolygon::guaranteed_probability);
        if (frame_.reason != Reason::none) polygon.outer_probability = polygon.guaranteed_probability = std::nullopt;
    }

    // Compute the hull of one polygon of all standing feet, on the common ground, and its probability.
    void join(Polygon SupportingPolygon::* kind, std::optional<double> SupportingPolygon::* probability) noexcept {
        points_.clear();
        bool has_probability = true;
        double wrong = 0;
        for (std::size_t k = 0; k < skins.size() && !frame_.is_foot_lost; ++k) {
            if (!frame_.standing[k]) continue;
            const SupportingPolygon& own = frame_.links[k]->polygon;
            for (const Vec2& corner : (own.*kind).corners) points_.push_back(on_ground(k, corner));
            has_probability = has_probability && probability && own.*probability;
            if (has_probability) wrong += 1 - *(own.*probability);
        }
        hull_.hull_of(points_);
        (frame_.polygon.*kind).corners.assign(hull_.hull.corners.begin(), hull_.hull.corners.end());
        if (!probability) return;
        frame_.polygon.*probability = has_probability ? std::optional<double>(std::max(0.0, 1 - wrong)) : std::nullopt;
    }

    std::vector<Pose> poses_;
    std::vector<Vec2> points_;
    HullTable hull_;
    BodyFrame frame_;
};

} // namespace skin_calib
