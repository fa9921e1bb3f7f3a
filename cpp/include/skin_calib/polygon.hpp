// Convex polygons: exact hulls of points on a grid, and how they are moved in. See runtime/hull.py and polygon.py.
#pragma once

#include "types.hpp"

namespace skin_calib {

// Return twice the area of a triangle, positive if it turns left. The sign is exact for coordinates without underflow.
inline double turn(const Vec2& a, const Vec2& b, const Vec2& c) noexcept {
    constexpr double rounding_bound = 3.3306690738754716e-16, underflow_limit = 1e-290; // Shewchuk 1997
    const double first = (b[0] - a[0]) * (c[1] - a[1]), second = (b[1] - a[1]) * (c[0] - a[0]);
    if (std::abs(first - second) > rounding_bound * (std::abs(first) + std::abs(second)) + underflow_limit)
        return first - second;
    // The sum of all products, as an expansion whose parts do not overlap: the last one that is not zero has the sign.
    const Vec2 products[] = {{b[0], c[1]}, {-b[0], a[1]}, {-a[0], c[1]}, {-b[1], c[0]}, {b[1], a[0]}, {a[1], c[0]}};
    std::array<double, 12> parts{};
    std::size_t count = 0;
    for (const Vec2& p : products) {
        const double high = p[0] * p[1];
        for (double term : {std::fma(p[0], p[1], -high), high}) {
            for (std::size_t k = 0; k < count; ++k) {
                const double sum = term + parts[k], other = sum - term;
                parts[k] = (term - (sum - other)) + (parts[k] - other);
                term = sum;
            }
            parts[count++] = term;
        }
    }
    while (count > 0 && parts[count - 1] == 0) --count;
    return count == 0 ? 0.0 : parts[count - 1] > 0 ? 1.0 : -1.0;
}

// A convex polygon with counter-clockwise corners [m]; also a segment, a point, or an empty polygon.
struct Polygon {
    std::vector<Vec2> corners;

    // Return the area [m^2].
    double area() const noexcept {
        double twice = 0;
        for (std::size_t k = 2; k < corners.size(); ++k) {
            const Vec2 a = arm(k - 1, 0), b = arm(k, 0);
            twice += a[0] * b[1] - a[1] * b[0];
        }
        return twice / 2;
    }

    // Return whether a point is inside or on the border; not if it is not finite.
    bool contains(const Vec2& p) const noexcept {
        if (corners.empty() || !all_finite(p)) return false;
        if (corners.size() == 1) return corners[0] == p;
        for (std::size_t k = 0; k < corners.size(); ++k)
            if (!(turn(corners[k], next(k), p) >= 0)) return false;
        const auto [ax, bx] = std::minmax(corners[0][0], corners[1][0]);
        const auto [ay, by] = std::minmax(corners[0][1], corners[1][1]);
        return corners.size() > 2 || (ax <= p[0] && p[0] <= bx && ay <= p[1] && p[1] <= by);
    }

    // Return the distance of a point to the border [m]: positive inside, negative outside; -infinity if empty.
    double margin(const Vec2& p) const noexcept {
        const std::optional<Vec2> near = closest(p);
        if (!near) return -infinity;
        if (!contains(p)) return -std::hypot((*near)[0] - p[0], (*near)[1] - p[1]);
        double least = corners.size() > 2 ? infinity : 0.0;
        for (std::size_t k = 0; corners.size() > 2 && k < corners.size(); ++k) {
            const Vec2 u = along(k);
            least = std::min(least, u[0] * (p[1] - corners[k][1]) - u[1] * (p[0] - corners[k][0]));
        }
        return std::max(least, 0.0);
    }

    // Return the point of the polygon nearest to a point: itself if it is inside; nothing if empty or not finite.
    std::optional<Vec2> closest(const Vec2& p) const noexcept {
        if (corners.empty() || !all_finite(p)) return std::nullopt;
        if (contains(p)) return p;
        Vec2 best = corners[0];
        double least = infinity;
        for (std::size_t k = 0; k < corners.size(); ++k) {
            const Vec2 a = corners[k], e = arm((k + 1) % corners.size(), k);
            const double square = e[0] * e[0] + e[1] * e[1];
            const double t =
                square > 0 ? std::clamp(((p[0] - a[0]) * e[0] + (p[1] - a[1]) * e[1]) / square, 0.0, 1.0) : 0;
            const Vec2 foot{a[0] + t * e[0], a[1] + t * e[1]};
            const double distance = std::hypot(foot[0] - p[0], foot[1] - p[1]);
            if (distance < least) least = distance, best = foot;
        }
        return best;
    }

    const Vec2& next(std::size_t k) const noexcept { return corners[k + 1 < corners.size() ? k + 1 : 0]; }

    // Return the vector from one corner to another.
    Vec2 arm(std::size_t to, std::size_t from) const noexcept {
        return {corners[to][0] - corners[from][0], corners[to][1] - corners[from][1]};
    }

    // Return the unit vector along the side that starts at a corner.
    Vec2 along(std::size_t k) const noexcept {
        const Vec2 e{next(k)[0] - corners[k][0], next(k)[1] - corners[k][1]};
        const double length = std::hypot(e[0], e[1]);
        return {e[0] / length, e[1] / length};
    }
};

// A set of points that computes the exact convex hull of some of them. Points are rounded to a grid of 2**-29 of their
// size; decisions are signs of whole numbers. An unchanged choice keeps its hull.
class HullTable {
public:
    Polygon hull; // of the rows that were chosen last

    HullTable() = default;
    HullTable(HullTable&&) = default; // a copy would lose the reserved memory
    HullTable& operator=(HullTable&&) = default;

    // Store rows of `each` points. Points that are not finite give empty hulls.
    HullTable(const std::vector<Vec2>& points, std::size_t each) : each_(each) {
        reserve(points.size());
        build(points);
        which_.assign(points.size() / each, 0);
    }

    // Choose some rows (rows,), and return whether the hull has changed.
    bool choose(const Booleans& rows) noexcept {
        if (rows == which_) return false;
        which_ = rows;
        std::fill(chosen_.begin(), chosen_.end(), 0);
        for (std::size_t row = 0; row < rows.size(); ++row)
            if (rows[row])
                for (std::size_t k = 0; k < each_; ++k) chosen_[rank_[row * each_ + k]] = 1;
        return chain();
    }

    // Allocate memory for sets of this many points.
    void reserve(std::size_t count) {
        for (auto* list : {&points_, &lower_, &upper_, &corners_, &last_}) list->reserve(count + 1);
        order_.reserve(count), rank_.reserve(count), columns_.reserve(count + 1), chosen_.reserve(count + 1);
        hull.corners.reserve(count + 1);
    }

    // Compute the hull of points; allocates nothing if `reserve` was called for as many.
    void hull_of(const std::vector<Vec2>& points) {
        build(points);
        std::fill(chosen_.begin(), chosen_.end(), 1);
        chain();
    }

private:
    using GridPoint = std::array<std::int64_t, 2>;

    // Return the smallest power of two with which coordinates up to `size` are below 2**29 steps.
    static double grid_step(double size) noexcept {
        int exponent = 0;
        std::frexp(size, &exponent);
        const double step = std::ldexp(1.0, std::max(exponent - 29, -1074));
        return std::nearbyint(size / step) < 536870912.0 ? step : 2 * step;
    }

    // Sort the distinct points by x and then y; points with equal x are a column.
    void build(const std::vector<Vec2>& points) {
        double size = 0;
        bool is_finite = true;
        for (const Vec2& p : points) {
            is_finite = is_finite && all_finite(p);
            size = std::max({size, std::abs(p[0]), std::abs(p[1])});
        }
        const std::size_t count = is_finite ? points.size() : 0;
        step_ = grid_step(is_finite ? size : 0.0);
        corners_.clear(), points_.clear(), columns_.clear(), hull.corners.clear();
        for (std::size_t k = 0; k < count; ++k)
            corners_.push_back({static_cast<std::int64_t>(std::nearbyint(points[k][0] / step_)),
                                static_cast<std::int64_t>(std::nearbyint(points[k][1] / step_))});
        order_.resize(count), rank_.assign(points.size(), 0);
        std::iota(order_.begin(), order_.end(), 0);
        std::sort(order_.begin(), order_.end(), [this](auto i, auto j) { return corners_[i] < corners_[j]; });
        for (std::size_t i : order_) {
            if (points_.empty() || points_.back() != corners_[i]) {
                if (points_.empty() || points_.back()[0] != corners_[i][0]) columns_.push_back(points_.size());
                points_.push_back(corners_[i]);
            }
            rank_[i] = points_.size() - 1;
        }
        columns_.push_back(points_.size());
        chosen_.assign(std::max<std::size_t>(points_.size(), 1), 0);
        corners_.clear();
    }

    // Compute the hull of the chosen points from the lowest and the highest one of each column.
    bool chain() noexcept {
        lower_.clear(), upper_.clear();
        for (std::size_t k = 0; k + 1 < columns_.size(); ++k) {
            std::size_t low = columns_[k], high = columns_[k + 1];
            while (low < high && !chosen_[low]) ++low;
            if (low == high) continue;
            while (!chosen_[high - 1]) --high;
            add(lower_, points_[low], 1);
            add(upper_, points_[high - 1], -1);
        }
        std::swap(corners_, last_);
        corners_.assign(lower_.begin(), lower_.end());
        for (std::size_t k = upper_.size(); k-- > 0;)
            if (upper_[k] != corners_.back() && upper_[k] != corners_.front()) corners_.push_back(upper_[k]);
        if (corners_ == last_) return false;
        hull.corners.clear();
        for (const GridPoint& p : corners_)
            hull.corners.push_back({static_cast<double>(p[0]) * step_, static_cast<double>(p[1]) * step_});
        return true;
    }

    // Add a point to a chain that turns to one side (Andrew's monotone chain).
    static void add(std::vector<GridPoint>& chain, const GridPoint& p, std::int64_t side) noexcept {
        while (chain.size() > 1) {
            const GridPoint &a = chain[chain.size() - 2], &b = chain.back();
            if (side * ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) > 0) break;
            chain.pop_back();
        }
        chain.push_back(p);
    }

    std::size_t each_ = 1;
    double step_ = 1;
    std::vector<GridPoint> points_, lower_, upper_, corners_, last_;
    std::vector<std::size_t> order_, rank_, columns_;
    Booleans chosen_, which_;
};

// Move the sides of a polygon in by a cell, so that what is left is surely inside of the true contact.
class Erosion {
public:
    Polygon result;

    Erosion() = default;
    Erosion(Erosion&&) = default; // a copy would lose the reserved memory
    Erosion& operator=(Erosion&&) = default;

    // Allocate memory for polygons of up to `count` corners and a cell, whose corners are about its centre [m].
    Erosion(std::vector<Vec2> cell, std::size_t count) : cell_(std::move(cell)) {
        for (auto* list : {&edges_, &moved_, &chain_, &result.corners}) list->reserve(3 * count + 8);
        extents_.reserve(count), left_.reserve(count), kept_.reserve(count), ring_.reserve(4 * count + 8);
    }

    // Compute the Minkowski difference of a polygon and the point reflection of the cell (Polygon.eroded in Python).
    void erode(const Polygon& polygon) noexcept {
        result.corners.clear();
        const auto& loop = polygon.corners;
        if (loop.size() < 3) return;
        edges_.clear(), extents_.clear();
        for (std::size_t k = 0; k < loop.size(); ++k) {
            const Vec2 e{polygon.next(k)[0] - loop[k][0], polygon.next(k)[1] - loop[k][1]};
            double extent = 0.0;
            for (const Vec2& q : cell_) extent = std::max(extent, e[0] * q[1] - e[1] * q[0]);
            edges_.push_back(e), extents_.push_back(extent);
        }
        if (!move_corners(loop)) cut(loop);
        make_convex();
    }

private:
    // Intersect the moved sides of neighbours; a side that would run backwards is left out. Return whether it worked.
    bool move_corners(const std::vector<Vec2>& loop) noexcept {
        left_.resize(loop.size());
        std::iota(left_.begin(), left_.end(), 0);
        while (!left_.empty()) {
            moved_.clear(), kept_.clear();
            std::size_t i = left_.back();
            for (std::size_t j : left_) {
                const auto [ax, ay] = edges_[i];
                const auto [bx, by] = edges_[j];
                const double turns = ax * by - ay * bx;
                if (!(1e-290 < turns && turns < infinity)) return false;
                const double a = extents_[i] - (ax * (loop[j][1] - loop[i][1]) - ay * (loop[j][0] - loop[i][0]));
                const double b = extents_[j];
                moved_.push_back({loop[j][0] + (a * bx - b * ax) / turns, loop[j][1] + (a * by - b * ay) / turns});
                i = j;
            }
            bool was_kept = true;
            for (std::size_t k = 0; k < left_.size(); ++k) {
                const Vec2 &from = moved_[k], &to = moved_[k + 1 < moved_.size() ? k + 1 : 0], &e = edges_[left_[k]];
                was_kept = !was_kept || (to[0] - from[0]) * e[0] + (to[1] - from[1]) * e[1] > 0;
                if (was_kept) kept_.push_back(left_[k]); // the neighbours of one left out stay
            }
            if (kept_.size() == left_.size()) return true;
            if (!was_kept && !kept_.empty() && kept_[0] != left_[0]) kept_.insert(kept_.begin(), left_[0]);
            std::swap(left_, kept_);
        }
        return false;
    }

    struct Corner {
        Vec2 point;
        std::size_t side; // that starts at it
    };

    // Cut a strip off along each side, one after the other, from a loop that is opened at the side.
    void cut(const std::vector<Vec2>& loop) noexcept {
        ring_.clear(), moved_.clear();
        for (std::size_t k = 0; k < loop.size(); ++k) ring_.push_back({loop[k], k});
        for (std::size_t k = 0; k < loop.size(); ++k) {
            const double length = std::hypot(edges_[k][0], edges_[k][1]), distance = extents_[k] / length;
            const Vec2 u{edges_[k][0] / length, edges_[k][1] / length};
            const auto depth = [&](const Corner& c) {
                return u[0] * (c.point[1] - loop[k][1]) - u[1] * (c.point[0] - loop[k][0]) - distance;
            };
            if (ring_.front().side == k) std::rotate(ring_.begin(), ring_.begin() + 1, ring_.end());
            double first = depth(ring_.front()), last = depth(ring_.back());
            if (first >= 0 && last >= 0) continue;
            Corner ahead = ring_.back(), behind = ring_.front(); // the last removed ones, at both ends
            double out_ahead = last, out_behind = first;
            std::size_t start = 0;
            while (first < 0) {
                ahead = ring_[start++], out_ahead = first;
                if (start == ring_.size()) return;
                first = depth(ring_[start]);
            }
            while (last < 0) {
                behind = ring_.back(), out_behind = last;
                ring_.pop_back();
                last = depth(ring_.back());
            }
            ring_.erase(ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(start));
            const Corner front = ring_.front(), back = ring_.back();
            if (ahead.side != k) // else rounding removed the start of the side but not its end: keep the end
                ring_.insert(ring_.begin(), {between(front, first, ahead, out_ahead), ahead.side});
            ring_.push_back({between(back, last, behind, out_behind), k});
        }
        for (const Corner& c : ring_) moved_.push_back(c.point);
    }

    // Return the point at which an edge is cut, from the depths of its ends: inside positive, outside negative.
    static Vec2 between(const Corner& kept, double inside, const Corner& removed, double outside) noexcept {
        const double t = inside / (inside - outside);
        return {kept.point[0] + t * (removed.point[0] - kept.point[0]),
                kept.point[1] + t * (removed.point[1] - kept.point[1])};
    }

    // Keep the corners of the hull of the moved points, by exact turns; mostly these are the points themselves.
    void make_convex() noexcept {
        const std::size_t n = moved_.size();
        bool is_convex = n > 2;
        for (std::size_t k = 0; is_convex && k < n; ++k)
            is_convex = turn(moved_[(k + n - 2) % n], moved_[(k + n - 1) % n], moved_[k]) > 0;
        if (!is_convex) {
            std::sort(moved_.begin(), moved_.end());
            moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
        }
        if (is_convex || moved_.size() < 3) {
            result.corners.assign(moved_.begin(), moved_.end());
            return;
        }
        add_lefts(moved_.begin(), moved_.end());
        add_lefts(moved_.rbegin(), moved_.rend());
    }

    // Add the chain that turns left from the first to the last of sorted points, without the last one.
    template <class Iterator> void add_lefts(Iterator first, Iterator last) noexcept {
        chain_.clear();
        for (; first != last; ++first) {
            while (chain_.size() > 1 && turn(chain_[chain_.size() - 2], chain_.back(), *first) <= 0) chain_.pop_back();
            chain_.push_back(*first);
        }
        result.corners.insert(result.corners.end(), chain_.begin(), chain_.end() - 1);
    }

    std::vector<Vec2> cell_, edges_, moved_, chain_;
    Numbers extents_;
    std::vector<std::size_t> left_, kept_;
    std::vector<Corner> ring_;
};

} // namespace skin_calib
