(* The upper bound: a point of each part, from vertices and weights. *)
From Coq Require Import Reals Lra Psatz ZArith List.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors Rounding Bounds Lower Point.
Open Scope R_scope.

Definition fupper (length radius error : R) : R := fl (fl (length - radius) + error).
Lemma upper_is : @Model.upper_from_point binary64 = fupper. Proof. reflexivity. Qed.

(* The arithmetic of it: the computed length n of the point, and the exact distance of the two points of the cores. *)
Lemma upper_core : forall acc ex ab m L W ew core S r_a r_b error,
  1 <= m <= 4 -> Rabs (L - 1) <= 4.03 * u -> deep m acc ex ab -> len ab <= L * W -> len (minus ex (times L core)) <= L * ew ->
  0 <= S -> W <= (1 + 20 * u) * S + 40 * eta -> ew <= 19.67 * u * S + 40 * eta -> 0 <= W -> 0 <= ew ->
  0 <= r_a -> 0 <= r_b ->
  34 * u * (S + (r_a + r_b)) + 0.9 * margin <= error ->
  len core - r_a - r_b <= fupper (fnorm acc) (fl (r_a + r_b)) error.
Proof.
  intros acc ex ab m L W ew core S ra rb error Hm HL (D1 & D2 & D3) HB HE HS HW Hew W0 ew0 Ha Hb He.
  apply Rabs_le_inv in HL. pose proof u_pos as U. pose proof eta_small as Eta. pose proof h_pos.
  assert (Km : 0 <= kDeep m <= 4.000004 * u) by (unfold kDeep; split; nra).
  assert (Tm : 0 <= m * (4 * eta) <= 16 * eta) by (split; nra).
  assert (One : forall p q r, deep1 m p q r -> Rabs (p - q) <= 4.000004 * u * Rabs r + 16 * eta).
  { intros p q r [D _]. eapply Rle_trans; [exact D|]. apply Rplus_le_compat; [|lra].
    apply Rle_trans with (kDeep m * Rabs r); [apply Rmult_le_compat_l; [lra|apply Rle_abs]|].
    apply Rmult_le_compat_r; [apply Rabs_pos|lra]. }
  assert (A : len (minus acc ex) <= 4.000004 * u * len ab + 2 * (16 * eta)).
  { apply len_by_coordinates; try lra; apply One; assumption. }
  assert (B : L * W <= (1 + 4.03 * u) * W) by (apply Rmult_le_compat_r; lra).
  assert (C : L * ew <= (1 + 4.03 * u) * ew) by (apply Rmult_le_compat_r; lra).
  assert (E : len ex <= len ab).
  { apply len_mono; [apply D1|apply D2|apply D3]. }
  assert (F : L * len core <= len ex + L * ew).
  { rewrite <- (Rabs_pos_eq L) at 1 by num. rewrite <- len_times.
    pose proof (len_near (times L core) ex) as G. rewrite len_minus_comm in G. lra. }
  pose proof (len_near ex acc) as G1. rewrite len_minus_comm in G1. pose proof (len_near acc ex) as G2.
  destruct (fnorm_err acc) as [N1 N2]. pose proof (fnorm_pos acc) as N0.
  pose proof (len_pos core) as P1. pose proof (len_pos acc) as P2. pose proof (len_pos ex) as P3. pose proof (len_pos ab) as P4.
  assert (F' : (1 - 4.03 * u) * len core <= L * len core) by (apply Rmult_le_compat_r; lra).
  pose proof (fl_err (ra + rb)) as Er. rewrite (Rabs_pos_eq (ra + rb)) in Er by lra.
  unfold fupper. set (r := fl (ra + rb)) in *. set (n := fnorm acc) in *.
  pose proof (fl_err (n - r)) as E1. set (y := fl (n - r)) in *.
  pose proof (fl_err (y + error)) as E2. set (out := fl (y + error)) in *.
  assert (He0 : 0 <= error).
  { eapply Rle_trans; [|exact He]. unfold margin, e150, u. lra. }
  apply Rabs_le_inv in Er.
  assert (Bn : n <= (1 + 50 * u) * S + 100 * h).
  { pose proof eta_le_h. clear - HS HW B HB E A G2 N2 Eta H H0 W0. unfold u in *. lra. }
  assert (Br : 0 <= r <= (1 + 2 * u) * (ra + rb) + eta).
  { split; [apply fl_pos; lra|]. unfold u in *. lra. }
  assert (B1 : Rabs (n - r) <= n + r) by (apply Rabs_le; lra).
  assert (By : Rabs y <= (1 + 60 * u) * (S + (ra + rb)) + 200 * h).
  { replace y with ((n - r) + (y - (n - r))) by ring. eapply Rle_trans; [apply Rabs_triang|].
    pose proof eta_le_h. clear - E1 B1 Br Bn HS Ha Hb H0 H Eta. unfold u in *. lra. }
  assert (B2 : Rabs (y + error) <= Rabs y + error).
  { eapply Rle_trans; [apply Rabs_triang|]. rewrite (Rabs_pos_eq error) by assumption. lra. }
  apply Rabs_le_inv in E1, E2.
  pose proof eta_le_h as Eh.
  assert (Core : (1 - 4.03 * u) * len core <= len acc + (4.000004 * u * ((1 + 4.03 * u) * W) + 32 * eta) + (1 + 4.03 * u) * ew).
  { clear - F F' C A G1 B HB U Eta P4. unfold u in *. lra. }
  set (c := len core) in *. set (a := len acc) in *.
  assert (Ca : a <= (1 + 53 * u) * S + 103 * h).
  { clear - N1 Bn HS Eh Eta H. unfold u in *. lra. }
  assert (C1 : c <= n + 30.3 * u * S + 10 * h).
  { clear - Core N1 Bn HW Hew HS Eh Eta H P1 N0 Ca. small. lra. }
  clear - C1 E1 E2 By B2 Er Br Bn B1 He HS Ha Hb Eta H N0 He0. small. lra.
Qed.
