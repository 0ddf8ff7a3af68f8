// See pose_graph.h. Pieces of cameras and pieces of boards grow together. X(view), the pose of the
// board's piece in the camera's piece, is known of every view; at one place
//     two pieces of cameras, A and B, and one of boards:   B_from_A = X(b) X(a)^-1
//     one piece of cameras and two of boards, P and Q:     Q_from_P = X(b)^-1 X(a)
#include "host/solve/pose_graph.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>

#include "host/base/median.h"
#include "host/solve/hand_eye.h"
#include "host/solve/view_kernel.h"

namespace rig {
namespace {

constexpr std::size_t kPairPosesMax = 64;  // relative poses of a pair that are compared
constexpr std::size_t kTryPoints = 40;     // points of a view that a body's pose is tried on
constexpr std::size_t kTryViews = 32;      // views of a body that its pose is tried on
constexpr double kTryErrorMaxPx = 100.0;

using ViewPair = std::pair<std::size_t, std::size_t>;

// Cameras, or boards: each belongs to a piece, whose frame is that of one of them.
struct Pieces {
    std::vector<int> piece;
    std::vector<Pose> own_from_piece;

    explicit Pieces(std::size_t count) : piece(count), own_from_piece(count)
    {
        std::iota(piece.begin(), piece.end(), 0);
    }
    int of(int index) const { return piece[static_cast<std::size_t>(index)]; }
    // Piece b becomes a part of piece a; pieces keep the lower number.
    void merge(int a, int b, Pose b_from_a)
    {
        if (b < a) {
            std::swap(a, b);
            b_from_a = inverse(b_from_a);
        }
        for (std::size_t i = 0; i < piece.size(); ++i) {
            if (piece[i] == b) {
                piece[i] = a;
                own_from_piece[i] = own_from_piece[i] * b_from_a;
            }
        }
    }
};

// The relative pose that most of the others agree with. Ten milliradians or a hundredth of the
// distance count alike; a disagreement counts at most ten of these.
Pose most_agreed(const std::vector<Pose>& candidates, const std::vector<double>& distances_mm)
{
    std::size_t best = 0;
    double best_sum = HUGE_VAL;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        double sum = 0.0;
        for (std::size_t j = 0; j < candidates.size(); ++j) {
            const double turn = rotation_distance(candidates[i].rotation, candidates[j].rotation);
            const double shift =
                (candidates[i].translation_mm - candidates[j].translation_mm).norm() / distances_mm[j];
            sum += std::min(10.0, turn / 0.01 + shift / 0.01);
        }
        if (sum < best_sum) {
            best_sum = sum;
            best = i;
        }
    }
    return candidates[best];
}

class Forest {
public:
    // by_view null: only who hangs together is asked, poses stay the identity.
    Forest(const Scene& scene, const ViewSet& set, const std::vector<Pose>* by_view)
        : set_(set), by_view_(by_view), cameras_(scene.cameras.size()), boards_(scene.boards.size())
    {
        std::map<std::pair<int, std::int64_t>, std::vector<std::size_t>> places;
        for (std::size_t i = 0; i < set.views.size(); ++i) {
            const View& view = set.views[i];
            const Board& board = scene.boards[static_cast<std::size_t>(view.board)];
            places[{board.group, board.is_static ? 0 : view.frame}].push_back(i);
        }
        for (auto& [key, views] : places) {
            places_.push_back(largest_of_each(views));
        }
        while (join_heaviest() || join_by_motion()) {
        }
    }
    const Pieces& cameras() const { return cameras_; }
    const Pieces& boards() const { return boards_; }

private:
    // What does not move is seen at its one place in every frame: the largest view of each camera
    // and board says it all.
    std::vector<std::size_t> largest_of_each(const std::vector<std::size_t>& views) const
    {
        std::map<std::pair<int, int>, std::size_t> largest;
        for (const std::size_t i : views) {
            const View& view = set_.views[i];
            const auto [found, is_new] = largest.emplace(std::pair(view.camera, view.board), i);
            if (!is_new && view.points.size() > set_.views[found->second].points.size()) {
                found->second = i;
            }
        }
        std::vector<std::size_t> kept;
        for (const auto& [key, view] : largest) {
            kept.push_back(view);
        }
        return kept;
    }
    int camera_piece(std::size_t view) const { return cameras_.of(set_.views[view].camera); }
    int board_piece(std::size_t view) const { return boards_.of(set_.views[view].board); }
    std::size_t weight(std::size_t a, std::size_t b) const
    {
        return std::min(set_.views[a].points.size(), set_.views[b].points.size());
    }
    // X(view) of the head of the file.
    Pose across(std::size_t view) const
    {
        const auto camera = static_cast<std::size_t>(set_.views[view].camera);
        const auto board = static_cast<std::size_t>(set_.views[view].board);
        return inverse(cameras_.own_from_piece[camera]) * (*by_view_)[view]
               * boards_.own_from_piece[board];
    }
    // Calls body(a, b) for all pairs of views at one place.
    template <typename Body>
    void for_pairs(const Body& body) const
    {
        for (const std::vector<std::size_t>& views : places_) {
            for (std::size_t i = 0; i < views.size(); ++i) {
                for (std::size_t j = i + 1; j < views.size(); ++j) {
                    body(views[i], views[j]);
                }
            }
        }
    }

    // Whether this pair joins cameras or boards, and which pieces, the lower first; false for
    // neither.
    struct Link {
        bool of_boards = false;
        int low = 0;
        int high = 0;
        bool operator<(const Link& other) const
        {
            return std::tie(of_boards, low, high) < std::tie(other.of_boards, other.low, other.high);
        }
        bool operator==(const Link& other) const { return !(*this < other) && !(other < *this); }
    };
    bool link_of(std::size_t a, std::size_t b, Link* link) const
    {
        const bool same_camera = camera_piece(a) == camera_piece(b);
        const bool same_board = board_piece(a) == board_piece(b);
        if (same_camera == same_board) {
            return false;
        }
        const int first = same_camera ? board_piece(a) : camera_piece(a);
        const int second = same_camera ? board_piece(b) : camera_piece(b);
        *link = {same_camera, std::min(first, second), std::max(first, second)};
        return true;
    }

    bool join_heaviest()
    {
        std::map<Link, std::size_t> weights;
        for_pairs([&](std::size_t a, std::size_t b) {
            Link link;
            if (link_of(a, b, &link)) {
                weights[link] += weight(a, b);
            }
        });
        const auto heaviest =
            std::max_element(weights.begin(), weights.end(),
                             [](const auto& x, const auto& y) { return x.second < y.second; });
        if (heaviest == weights.end()) {
            return false;
        }
        const Link chosen = heaviest->first;
        Pieces& pieces = chosen.of_boards ? boards_ : cameras_;
        pieces.merge(chosen.low, chosen.high,
                     by_view_ != nullptr ? relative_pose(chosen) : Pose());
        return true;
    }

    // high_from_low of a link's pieces.
    Pose relative_pose(const Link& link) const
    {
        std::vector<ViewPair> pairs;
        for_pairs([&](std::size_t a, std::size_t b) {
            Link here;
            if (link_of(a, b, &here) && here == link) {
                const int first = link.of_boards ? board_piece(a) : camera_piece(a);
                pairs.push_back(first == link.low ? ViewPair(a, b) : ViewPair(b, a));
            }
        });
        std::vector<Pose> candidates;
        std::vector<double> distances_mm;
        const std::size_t step = (pairs.size() + kPairPosesMax - 1) / kPairPosesMax;
        for (std::size_t i = 0; i < pairs.size(); i += step) {
            const Pose low = across(pairs[i].first);
            const Pose high = across(pairs[i].second);
            candidates.push_back(link.of_boards ? inverse(high) * low : high * inverse(low));
            distances_mm.push_back((*by_view_)[pairs[i].second].translation_mm.norm());
        }
        return most_agreed(candidates, distances_mm);
    }

    // Two pieces of cameras that see two pieces of boards of one group, each its own.
    struct Square {
        int cameras[2];
        int boards[2];
        bool operator<(const Square& other) const
        {
            return std::tie(cameras[0], cameras[1], boards[0], boards[1])
                   < std::tie(other.cameras[0], other.cameras[1], other.boards[0], other.boards[1]);
        }
    };

    bool join_by_motion()
    {
        // Of each place the pair with the most points.
        std::map<Square, std::vector<ViewPair>> squares;
        for (const std::vector<std::size_t>& views : places_) {
            std::map<Square, ViewPair> best;
            for (const std::size_t a : views) {
                for (const std::size_t b : views) {
                    if (camera_piece(a) < camera_piece(b) && board_piece(a) != board_piece(b)) {
                        const Square key{{camera_piece(a), camera_piece(b)},
                                         {board_piece(a), board_piece(b)}};
                        const auto [found, is_new] = best.emplace(key, ViewPair(a, b));
                        const ViewPair& old = found->second;
                        if (!is_new && weight(a, b) > weight(old.first, old.second)) {
                            found->second = {a, b};
                        }
                    }
                }
            }
            for (const auto& [key, pair] : best) {
                squares[key].push_back(pair);
            }
        }
        std::vector<std::pair<Square, std::vector<ViewPair>>> list(squares.begin(), squares.end());
        std::stable_sort(list.begin(), list.end(), [](const auto& x, const auto& y) {
            return x.second.size() > y.second.size();
        });
        for (const auto& [key, pairs] : list) {
            if (pairs.size() >= kHandEyeMin && join_square(key, pairs)) {
                return true;
            }
        }
        return false;
    }

    bool join_square(const Square& key, const std::vector<ViewPair>& pairs)
    {
        HandEye found;
        if (by_view_ != nullptr) {
            std::vector<Sighted> places;
            for (const auto& [a, b] : pairs) {
                places.push_back({across(a), across(b)});
            }
            const std::optional<HandEye> solved = solve_hand_eye(places);
            if (!solved) {
                return false;
            }
            found = *solved;
        }
        cameras_.merge(key.cameras[0], key.cameras[1], found.b_from_a);
        boards_.merge(key.boards[0], key.boards[1], inverse(found.p_from_q));
        return true;
    }

    const ViewSet& set_;
    const std::vector<Pose>* by_view_;
    Pieces cameras_;
    Pieces boards_;
    std::vector<std::vector<std::size_t>> places_;  // views of one group at one place
};

Connection connection_of(const Forest& forest)
{
    Connection out;
    std::map<int, std::vector<int>> by_piece;
    const std::vector<int>& pieces = forest.cameras().piece;
    for (std::size_t camera = 0; camera < pieces.size(); ++camera) {
        by_piece[pieces[camera]].push_back(static_cast<int>(camera));
    }
    for (auto& [piece, cameras] : by_piece) {
        out.parts.push_back(std::move(cameras));
    }
    std::stable_sort(out.parts.begin(), out.parts.end(),
                     [](const auto& x, const auto& y) { return x.size() > y.size(); });
    out.part_of_camera.resize(pieces.size());
    for (std::size_t part = 0; part < out.parts.size(); ++part) {
        for (const int camera : out.parts[part]) {
            out.part_of_camera[static_cast<std::size_t>(camera)] = static_cast<int>(part);
        }
    }
    // Pieces keep their lowest number, which is their first board.
    out.body_of_board = forest.boards().piece;
    return out;
}

// Median distance of a view's points from where this state puts them, px, bounded.
double misfit_px(const View& view, const RigState& state)
{
    Eigen::Matrix2Xd residuals;
    view_residuals(view, state, &residuals);
    std::vector<double> sizes;
    for (std::size_t i = 0; i < view.points.size(); ++i) {
        sizes.push_back(static_cast<double>(view.points[i].sigma_px)
                        * residuals.col(static_cast<Eigen::Index>(i)).norm());
    }
    return std::min(kTryErrorMaxPx, median_of(&sizes));
}

// Of the poses that each view says this body has, the one that suits all its views best.
Vector6 best_body_pose(const ViewSet& set, const std::vector<std::size_t>& all,
                       const std::vector<Pose>& by_view, RigState* state)
{
    std::vector<View> thin;
    std::vector<std::size_t> views;
    const std::size_t step = (all.size() + kTryViews - 1) / kTryViews;
    for (std::size_t i = 0; i < all.size(); i += step) {
        views.push_back(all[i]);
        thin.push_back(thinned(set.views[all[i]], kTryPoints));
    }
    Vector6 best = Vector6::Zero();
    double best_sum = HUGE_VAL;
    for (const std::size_t view : views) {
        const View& seen = set.views[view];
        Pose rig_from_body = inverse(pose_exp(state->cam_from_rig[static_cast<std::size_t>(seen.camera)]))
                             * by_view[view];
        if (seen.member != kNoMember) {
            rig_from_body = rig_from_body
                            * inverse(pose_exp(state->body_from_board[static_cast<std::size_t>(seen.member)]));
        }
        const Vector6 candidate = pose_log(rig_from_body);
        state->rig_from_body[seen.pose] = candidate;
        double sum = 0.0;
        for (const View& other : thin) {
            sum += misfit_px(other, *state);
        }
        if (sum < best_sum) {
            best_sum = sum;
            best = candidate;
        }
    }
    return best;
}

}  // namespace

Connection connect(const Scene& scene, const ViewSet& set)
{
    return connection_of(Forest(scene, set, nullptr));
}

RigState join_cameras(const Scene& scene, const std::vector<Camera>& lenses,
                      const std::vector<Pose>& by_view, ViewSet* set, Connection* connection)
{
    const Forest forest(scene, *set, &by_view);
    *connection = connection_of(forest);
    assign_poses(scene, connection->part_of_camera, connection->body_of_board, set);
    RigState state;
    state.lenses = lenses;
    for (std::size_t camera = 0; camera < lenses.size(); ++camera) {
        const int part = connection->part_of_camera[camera];
        const int first = connection->parts[static_cast<std::size_t>(part)].front();
        const std::vector<Pose>& poses = forest.cameras().own_from_piece;
        state.cam_from_rig.push_back(
            pose_log(poses[camera] * inverse(poses[static_cast<std::size_t>(first)])));
    }
    for (const int board : set->members) {
        const std::vector<Pose>& poses = forest.boards().own_from_piece;
        const auto body = static_cast<std::size_t>(connection->body_of_board[static_cast<std::size_t>(board)]);
        state.body_from_board.push_back(
            pose_log(poses[body] * inverse(poses[static_cast<std::size_t>(board)])));
    }
    state.rig_from_body.assign(set->poses.size(), Vector6::Zero());
    std::vector<std::vector<std::size_t>> by_pose(set->poses.size());
    for (std::size_t i = 0; i < set->views.size(); ++i) {
        by_pose[set->views[i].pose].push_back(i);
    }
    for (std::size_t pose = 0; pose < by_pose.size(); ++pose) {
        state.rig_from_body[pose] = best_body_pose(*set, by_pose[pose], by_view, &state);
    }
    return state;
}

}  // namespace rig
